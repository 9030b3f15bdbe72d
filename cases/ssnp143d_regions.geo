// Made by python -m damjoint_tools.gmsh_files, for dim = 3.
Include "../geo/window.geo";
Include "../geo/pressed.geo";
If(dim != 3)
  Error("dim = %g: must be 3, as the regions in this file", dim);
EndIf
Mesh.MshFileVersion = 2.2;
Delete Physicals;
Physical Point(9) = {6};
Physical Curve(7) = {34};
Physical Curve(8) = {25};
Physical Curve(1007) = {30};
Physical Curve(1008) = {26};
Physical Curve(2007) = {48};
Physical Curve(2008) = {52};
Physical Surface(3) = {39};
Physical Surface(6) = {81, 85, 89};
Physical Surface(1003) = {31};
Physical Surface(2003) = {53};
Physical Volume(1) = {1};
Physical Volume(2) = {3};
Physical Volume(1001) = {2};
