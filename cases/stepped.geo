// Mesh of stepped.case.
Include "../pro/units.pro";
Include "stepped.case";
// Made by python -m damjoint_tools.gmsh_files, for dim = 2.
Include "../geo/window.geo";
Include "../geo/stepped.geo";
If(dim != 2)
  Error("dim = %g: must be 2, as the regions in this file", dim);
EndIf
Mesh.MshFileVersion = 2.2;
Delete Physicals;
Physical Point(7) = {1};
Physical Point(8) = {6};
Physical Point(9) = {8};
Physical Curve(3) = {1 : 5};
Physical Curve(6) = {9 : 11};
Physical Curve(100) = {13};
Physical Curve(101) = {6};
Physical Curve(102) = {7};
Physical Surface(1) = {1};
Physical Surface(2) = {2};
