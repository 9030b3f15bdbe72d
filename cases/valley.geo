// Mesh of valley.case.
Include "../pro/units.pro";
Include "valley.case";
// Made by python -m damjoint_tools.gmsh_files, for dim = 3.
Include "../geo/window.geo";
Include "../geo/valley.geo";
If(dim != 3)
  Error("dim = %g: must be 3, as the regions in this file", dim);
EndIf
Mesh.MshFileVersion = 2.2;
Delete Physicals;
Physical Point(9) = {28};
Physical Curve(7) = {2 : 3};
Physical Curve(8) = {10 : 11};
Physical Surface(3) = {3};
Physical Surface(6) = {8 : 12};
Physical Surface(100) = {1};
Physical Surface(101) = {6};
Physical Surface(102) = {5};
Physical Volume(1) = {2};
Physical Volume(2) = {1};
