// Mesh of ssnp166.case.
Include "../pro/units.pro";
Include "ssnp166.case";
// Made by python -m damjoint_tools.gmsh_files, for dim = 2.
Include "../geo/window.geo";
Include "../geo/ssnp166.geo";
If(dim != 2)
  Error("dim = %g: must be 2, as the regions in this file", dim);
EndIf
Mesh.MshFileVersion = 2.2;
Delete Physicals;
Physical Point(7) = {1};
Physical Point(8) = {2};
Physical Point(9) = {3};
Physical Point(13) = {1};
Physical Point(15) = {3};
Physical Point(1007) = {4};
Physical Point(1008) = {5};
Physical Curve(3) = {1};
Physical Curve(6) = {10 : 12};
Physical Curve(1003) = {4};
Physical Surface(1) = {1};
Physical Surface(2) = {2};
