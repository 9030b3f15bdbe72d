// stepped.geo - a 45 m dam on three benches that rise downstream.
// Example of a user's own geometry: only the names of the physical groups are prescribed.

Include "../pro/parameters.pro";

h_joint = 34 / n_joint;
rise = 2;  // of a step [m]

Point(1) = {0, 0, 0, h_joint};  // heel
Point(2) = {12, 0, 0, h_joint};
Point(3) = {12, rise, 0, h_joint};
Point(4) = {24, rise, 0, h_joint};
Point(5) = {24, 2 * rise, 0, h_joint};
Point(6) = {34, 2 * rise, 0, h_joint};  // toe
Point(7) = {5, 45, 0, h_dam};
Point(8) = {0, 45, 0, h_dam};
Point(9) = {-90, 0, 0, h_found};
Point(10) = {-90, -90, 0, h_found};
Point(11) = {124, -90, 0, h_found};
Point(12) = {124, 2 * rise, 0, h_found};
For i In {1 : 7}
  Line(i) = {i, i + 1};
EndFor
For i In {9 : 11}
  Line(i) = {i, i + 1};
EndFor
Line(12) = {12, 6};
Line(13) = {8, 1};
Line(14) = {1, 9};
Curve Loop(1) = {1, 2, 3, 4, 5, 6, 7, 13};
Plane Surface(1) = {1};
Curve Loop(2) = {14, 9, 10, 11, 12, -5, -4, -3, -2, -1};
Plane Surface(2) = {2};

Physical Surface("dam") = {1};
Physical Surface("foundation") = {2};
Physical Curve("joint") = {1, 2, 3, 4, 5};
Physical Curve("upstream") = {13};
Physical Curve("downstream") = {6};
Physical Curve("crest surface") = {7};
Physical Curve("fixed") = {9, 10, 11};
Physical Point("heel") = {1};
Physical Point("toe") = {6};
Physical Point("crest") = {8};
