// Mesh of j_file.case.
// Made by python -m damjoint_tools.gmsh_files j_file.case, for dim = 2.
Include "../pro/units.pro";
Include "j_file.case";
Include "../geo/window.geo";
Include "../geo/ssnp142_file.geo";
If(dim != 2)
  Error("dim = %g: must be 2, as in j_file.case", dim);
EndIf
Mesh.MshFileVersion = 2.2;
Delete Physicals;
Physical Point(7) = {100};
Physical Point(8) = {150};
Physical Point(9) = {301};
Physical Curve(3) = {100, 101, 102, 103, 104, 105, 106, 107, 108, 109, 110, 111, 112, 113, 114, 115, 116, 117, 118, 119, 120, 121, 122, 123, 124, 125, 126, 127, 128, 129, 130, 131, 132, 133, 134, 135, 136, 137, 138, 139, 140, 141, 142, 143, 144, 145, 146, 147, 148, 149};
Physical Curve(6) = {502, 503, 504, 505, 506};
Physical Curve(100) = {301, 400};
Physical Curve(101) = {302, 450};
Physical Surface(1) = {100, 101, 102, 103, 104, 105, 106, 107, 108, 109, 110, 111, 112, 113, 114, 115, 116, 117, 118, 119, 120, 121, 122, 123, 124, 125, 126, 127, 128, 129, 130, 131, 132, 133, 134, 135, 136, 137, 138, 139, 140, 141, 142, 143, 144, 145, 146, 147, 148, 149, 200};
Physical Surface(2) = {501, 502, 503};
ReverseMesh Curve {301, 400};
