// ssnp166.geo - half of a notched beam under three-point bending (SSNP166, after Petersson 1981):
// the half x > 0, whose ligament meets a rigid wall in a joint of half the opening. Span 2 m,
// height 0.2 m, notch 0.1 m deep. A joint without normal stress holds its end face in y: what a
// support at a point does, but for the dent there, which depends on the mesh.
//
// 67 elements on the ligament, as published; the size grows from there.

Include "../pro/parameters.pro";

length = 1.0001;
height = 0.2;
tip = 0.1;  // of the notch
lip = 0.001;  // half of its width at the lower face
wall = 0.02;
Point(1) = {0, height, 0};
Point(2) = {0, tip, 0};
Point(3) = {lip, 0, 0};
Point(4) = {length, 0, 0};
Point(5) = {length, height, 0};
For i In {1 : 5}
  Line(i) = {i, (i == 5) ? 1 : i + 1};
EndFor
Curve Loop(1) = {1 : 5};
Plane Surface(1) = {1};
// A rigid trough: the wall, what is under the beam, and what holds the end face
Point(6) = {length, -wall, 0};
Point(7) = {0, -wall, 0};
Point(8) = {-wall, height, 0};
Point(9) = {-wall, -2 * wall, 0};
Point(10) = {length + wall, -2 * wall, 0};
Point(11) = {length + wall, height, 0};
Line(6) = {4, 6};
Line(7) = {6, 7};
Line(8) = {7, 2};
Line(9) = {1, 8};
Line(10) = {8, 9};
Line(11) = {9, 10};
Line(12) = {10, 11};
Line(13) = {11, 5};
Curve Loop(2) = {4, -13, -12, -11, -10, -9, 1, -8, -7, -6};
Plane Surface(2) = {2};

Transfinite Curve {1} = 67 + 1;
Transfinite Curve {4} = 10 + 1;
Field[1] = Distance;
Field[1].CurvesList = {1};
Field[1].Sampling = 200;
Field[2] = MathEval;
Field[2].F = "0.0015 + 0.15 * F1";
Field[3] = MathEval;
Field[3].F = "0.025";
Field[4] = Min;
Field[4].FieldsList = {2, 3};
Background Field = 4;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

Physical Surface("foundation") = {2};
Physical Surface("dam") = {1};
Physical Curve("joint ligament") = {1};
Physical Curve("joint support") = {4};
Physical Curve("fixed") = {10 : 12};
Physical Point("heel ligament") = {1};
Physical Point("toe ligament") = {2};
Physical Point("heel support") = {4};
Physical Point("toe support") = {5};
Physical Point("force") = {1};
Physical Point("point") = {3};
Physical Point("crest") = {3};
