// Made by python -m damjoint_tools.gmsh_files, for dim = 3.
Include "../geo/window.geo";
Include "../geo/blocks.geo";
If(dim != 3)
  Error("dim = %g: must be 3, as the regions in this file", dim);
EndIf
Mesh.MshFileVersion = 2.2;
Delete Physicals;
Physical Point(9) = {6};
Physical Curve(7) = {26};
Physical Curve(8) = {17};
Physical Curve(1007) = {17};
Physical Curve(1008) = {40};
Physical Curve(2007) = {18};
Physical Curve(2008) = {17};
Physical Surface(3) = {31};
Physical Surface(6) = {72};
Physical Surface(1003) = {41};
Physical Surface(2003) = {19};
Physical Volume(1) = {1};
Physical Volume(2) = {3};
Physical Volume(1001) = {2};
