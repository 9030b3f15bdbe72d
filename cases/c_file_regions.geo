// Made by python -m damjoint_tools.gmsh_files, for dim = 2.
Include "../geo/window.geo";
Include "../geo/ssnp142_file.geo";
If(dim != 2)
  Error("dim = %g: must be 2, as the regions in this file", dim);
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
