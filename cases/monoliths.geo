// Mesh of monoliths.case.
Include "../pro/units.pro";
Include "monoliths.case";
// Made by python -m damjoint_tools.gmsh_files, for dim = 2.
Include "../geo/window.geo";
Include "../geo/monoliths.geo";
If(dim != 2)
  Error("dim = %g: must be 2, as the regions in this file", dim);
EndIf
Mesh.MshFileVersion = 2.2;
Delete Physicals;
Physical Point(7) = {101};
Physical Point(8) = {102};
Physical Point(9) = {106};
Physical Point(1007) = {102};
Physical Point(1008) = {103};
Physical Point(2007) = {102};
Physical Point(2008) = {104};
Physical Curve(3) = {101};
Physical Curve(6) = {108 : 109, 112};
Physical Curve(100) = {105};
Physical Curve(1003) = {106};
Physical Curve(2003) = {102};
Physical Surface(1) = {101};
Physical Surface(2) = {1};
Physical Surface(1001) = {102};
