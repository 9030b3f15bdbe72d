// ssnp133.geo - a plate of 2 km by 1 km with a half round hole of 500 m radius at its lower side
// (SSNP133 A). Both ligaments of the lower side, of 650 m and 350 m, are joints on rigid strips.
//
// About as many elements as published: 9 and 10 on the joints, 413 triangles (402); finer by the
// factor n_joint / 10.

Include "../pro/parameters.pro";

left = -1150;
right = 850;
height = 1000;
radius = 500;
strip = 50;
Point(1) = {left, 0, 0};
Point(2) = {-radius, 0, 0};
Point(3) = {0, radius, 0};
Point(4) = {radius, 0, 0};
Point(5) = {right, 0, 0};
Point(6) = {right, height, 0};
Point(7) = {left, height, 0};
Point(8) = {0, 0, 0};
Line(1) = {1, 2};
Circle(2) = {2, 8, 3};
Circle(3) = {3, 8, 4};
Line(4) = {4, 5};
Line(5) = {5, 6};
Line(6) = {6, 7};
Line(7) = {7, 1};
Curve Loop(1) = {1 : 7};
Plane Surface(1) = {1};
Point(11) = {left, -strip, 0};
Point(12) = {right, -strip, 0};
Point(13) = {radius, -strip, 0};
Point(14) = {-radius, -strip, 0};
Line(11) = {11, 14};
Line(12) = {14, 13};
Line(13) = {13, 12};
Line(14) = {12, 5};
Line(15) = {4, 13};
Line(16) = {14, 2};
Line(17) = {1, 11};
Curve Loop(2) = {1, -16, -11, -17};
Plane Surface(2) = {2};
Curve Loop(3) = {4, -14, -13, -15};
Plane Surface(3) = {3};

finer = (n_joint > 10) ? n_joint / 10 : 1;
Transfinite Curve {1} = 9 * finer + 1;
Transfinite Curve {4} = 10 * finer + 1;
Transfinite Curve {2, 3} = 9 * finer + 1;
Transfinite Curve {5, 7} = 9 * finer + 1;
Transfinite Curve {6} = 16 * finer + 1;
Physical Surface("foundation") = {2, 3};
Physical Surface("dam") = {1};
Physical Curve("joint left") = {1};
Physical Curve("joint right") = {4};
Physical Curve("fixed") = {11, 13};
Physical Curve("traction") = {6};
Physical Point("heel left") = {1};
Physical Point("toe left") = {2};
Physical Point("heel right") = {4};
Physical Point("toe right") = {5};
Physical Point("point") = {3};
Physical Point("crest") = {7};
