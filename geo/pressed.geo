// pressed.geo - two blocks, 5 m wide and 10 m high, with a vertical joint between them, pressed
// together in a rigid trough (SSNP143 C, D): its walls and the blocks meet in joints that slide
// freely, so that all points of the vertical joint are alike. In 3D (dim = 3) 1 m thick.

Include "../pro/parameters.pro";

x() = {-5, 0, 5};
For i In {0 : 2}
  Point(1 + i) = {x(i), 0, 0};
  Point(4 + i) = {x(i), 10, 0};
  Line(1 + i) = {1 + i, 4 + i};
EndFor
Line(4) = {1, 2};
Line(5) = {2, 3};
Line(6) = {4, 5};
Line(7) = {5, 6};
Transfinite Curve {1 : 3} = 11;
Transfinite Curve {4 : 7} = 6;
Curve Loop(1) = {4, 2, -6, -1};
Curve Loop(2) = {5, 3, -7, -2};
Plane Surface(1) = {1};
Plane Surface(2) = {2};
Point(11) = {-6, 10, 0};
Point(12) = {-6, -2, 0};
Point(13) = {6, -2, 0};
Point(14) = {6, 10, 0};
Point(15) = {5, -1, 0};
Point(16) = {-5, -1, 0};
Line(11) = {4, 11};
Line(12) = {11, 12};
Line(13) = {12, 13};
Line(14) = {13, 14};
Line(15) = {14, 6};
Line(16) = {3, 15};
Line(17) = {15, 16};
Line(18) = {16, 1};
Curve Loop(3) = {11 : 15, -3, 16 : 18, 1};
Plane Surface(3) = {3};
points() = Point In BoundingBox {-7, -3, -1, 7, 11, 1};
MeshSize { points() } = 1;

If(dim == 2)
  Physical Surface("foundation") = {3};
  Physical Surface("dam left") = {1};
  Physical Surface("dam right") = {2};
  Physical Curve("fixed") = {12 : 14};
  Physical Curve("joint left wall") = {1};
  Physical Curve("joint vertical") = {2};
  Physical Curve("joint right wall") = {3};
  Physical Point("heel left wall") = {4};
  Physical Point("toe left wall") = {1};
  Physical Point("heel vertical") = {5};
  Physical Point("toe vertical") = {2};
  Physical Point("heel right wall") = {3};
  Physical Point("toe right wall") = {6};
Else
  Extrude {0, 0, 1} { Surface{1 : 3}; Layers{1}; }
  eps = 1e-3;
  names() = Str["left wall", "vertical", "right wall"];
  For i In {0 : 2}
    joint() = Surface In BoundingBox {x(i) - eps, -eps, -eps, x(i) + eps, 11, 2};
    top() = Curve In BoundingBox {x(i) - eps, 10 - eps, -eps, x(i) + eps, 11, 2};
    base() = Curve In BoundingBox {x(i) - eps, -eps, -eps, x(i) + eps, eps, 2};
    Physical Surface(StrCat("joint ", Str(names(i)))) = {joint()};
    Physical Curve(StrCat("heel ", Str(names(i)))) = {(i < 2) ? top(0) : base(0)};
    Physical Curve(StrCat("toe ", Str(names(i)))) = {(i < 2) ? base(0) : top(0)};
  EndFor
  left() = Volume In BoundingBox {-5 - eps, -eps, -eps, eps, 11, 2};
  right() = Volume In BoundingBox {-eps, -eps, -eps, 5 + eps, 11, 2};
  trough() = Volume In BoundingBox {-7, -3, -eps, 7, 11, 2};
  trough() -= {left(), right()};
  Physical Volume("foundation") = {trough()};
  Physical Volume("dam left") = {left()};
  Physical Volume("dam right") = {right()};
  fixed() = Surface In BoundingBox {-6 - eps, -3, -eps, -6 + eps, 11, 2};
  fixed() += Surface In BoundingBox {6 - eps, -3, -eps, 6 + eps, 11, 2};
  fixed() += Surface In BoundingBox {-7, -2 - eps, -eps, 7, -2 + eps, 2};
  Physical Surface("fixed") = {fixed()};
EndIf
Physical Point("crest") = {6};
