// Mesh of c_file.case.
// Made by python -m damjoint_tools.gmsh_files c_file.case, for dim = 2.
Include "../pro/units.pro";
Include "c_file.case";
Include "../geo/window.geo";
Include "../geo/ssnp142_file.geo";
If(dim != 2)
  Error("dim = %g: must be 2, as in c_file.case", dim);
EndIf
Mesh.MshFileVersion = 2.2;
Delete Physicals;
Physical Point(7) = {100};
Physical Point(8) = {150};
Physical Point(9) = {301};
Physical Curve(3) = {100 : 149};
Physical Curve(6) = {502 : 506};
Physical Curve(100) = {301, 400};
Physical Curve(101) = {302, 450};
Physical Surface(1) = {100 : 149, 200};
Physical Surface(2) = {501 : 503};
ReverseMesh Curve {301, 400};
