// Mesh of d_file.case.
Include "../pro/units.pro";
Include "d_file.case";
// Made by python -m damjoint_tools.gmsh_files, for dim = 3.
Include "../geo/window.geo";
Include "../geo/ssnp142_file.geo";
If(dim != 3)
  Error("dim = %g: must be 3, as the regions in this file", dim);
EndIf
Mesh.MshFileVersion = 2.2;
Delete Physicals;
Physical Point(9) = {301};
Physical Curve(7) = {515};
Physical Curve(8) = {1429};
Physical Surface(3) = {517, 535, 556, 573, 591, 612, 629, 647, 668, 685, 703, 724, 741, 759, 780,
797, 814, 832, 853, 870, 888, 909, 926, 944, 965, 982, 1000, 1021, 1038, 1056, 1077, 1094, 1112,
1133, 1150, 1168, 1189, 1206, 1224, 1245, 1262, 1280, 1301, 1318, 1336, 1357, 1374, 1392, 1413,
1430};
Physical Surface(6) = {1549, 1553, 1620, 1838, 1842};
Physical Surface(100) = {525, 1535};
Physical Volume(1) = {1 : 51};
Physical Volume(2) = {52 : 54};
