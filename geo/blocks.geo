// blocks.geo - two blocks, 5 m wide and 10 m high, with a vertical joint between them (SSNP143).
// Both stand on a rigid plate: what is fixed must not touch a joint. In 3D (dim = 3) 1 m thick.
//
// The edges of the blocks have the elements of the published mesh: 20 on the vertical joint, 11 on
// the outer sides, 9 on base and top, growing by 1.13 from the joint; in 3D 3 over the thickness at
// the joint and 1 at the outer sides. Between them the size grows likewise from the joint outwards:
// 550 triangles in 2D, published 548.

Include "../pro/parameters.pro";

Point(1) = {0, 0, 0};
Point(2) = {-5, 0, 0};
Point(3) = {5, 0, 0};
Point(4) = {0, 10, 0};
Point(5) = {-5, 10, 0};
Point(6) = {5, 10, 0};
Point(7) = {-5, -1, 0};
Point(8) = {5, -1, 0};
Line(1) = {1, 4};
Line(2) = {1, 2};
Line(3) = {1, 3};
Line(4) = {4, 5};
Line(5) = {4, 6};
Line(6) = {2, 5};
Line(7) = {3, 6};
Line(8) = {2, 7};
Line(9) = {7, 8};
Line(10) = {8, 3};
Curve Loop(1) = {1, 4, -6, -2};
Curve Loop(2) = {3, 7, -5, -1};
Curve Loop(3) = {2, 8, 9, 10, -3};
For i In {1 : 3}
  Plane Surface(i) = {i};
EndFor

eps = 1e-3;
If(dim == 3)
  Extrude {0, 0, 1} { Surface{1 : 3}; }
  thick() = Curve In BoundingBox {-5 - eps, -1 - eps, -eps, 5 + eps, 10 + eps, 1 + eps};
  Transfinite Curve {thick()} = 2;  // those over the thickness; the others below
EndIf
For z In {0 : dim - 2}
  plate() = Curve In BoundingBox {-5 - eps, -1 - eps, z - eps, 5 + eps, -1 + eps, z + eps};
  Transfinite Curve {plate()} = 10;
  For x In {-5 : 5 : 5}
    side() = Curve In BoundingBox {x - eps, -eps, z - eps, x + eps, 10 + eps, z + eps};
    Transfinite Curve {side()} = (x == 0) ? 21 : 12;
    below() = Curve In BoundingBox {x - eps, -1 - eps, z - eps, x + eps, eps, z + eps};
    Transfinite Curve {below()} = 3;
  EndFor
  For y In {0 : 10 : 10}
    level() = Curve In BoundingBox {-5 - eps, y - eps, z - eps, 5 + eps, y + eps, z + eps};
    Transfinite Curve {level()} = 10 Using Progression 1.13;
  EndFor
EndFor

Field[1] = MathEval;
Field[1].F = "0.5 + 0.08 * Fabs(x)";
Background Field = 1;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

If(dim == 2)
  Physical Surface("foundation") = {3};
  Physical Surface("dam left") = {1};
  Physical Surface("dam right") = {2};
  Physical Curve("joint left base") = {2};
  Physical Curve("joint right base") = {3};
  Physical Curve("joint vertical") = {1};
  Physical Curve("fixed") = {9};
  Physical Point("heel left base") = {2};
  Physical Point("toe left base") = {1};
  Physical Point("heel right base") = {1};
  Physical Point("toe right base") = {3};
  Physical Point("heel vertical") = {4};
  Physical Point("toe vertical") = {1};
Else
  For y In {0 : 10 : 10}
    joint() = Curve In BoundingBox {-eps, y - eps, -eps, eps, y + eps, 1 + eps};
    Transfinite Curve {joint()} = 4;
  EndFor
  left() = Volume In BoundingBox {-5 - eps, -eps, -eps, eps, 10 + eps, 1 + eps};
  right() = Volume In BoundingBox {-eps, -eps, -eps, 5 + eps, 10 + eps, 1 + eps};
  plate() = Volume In BoundingBox {-5 - eps, -1 - eps, -eps, 5 + eps, eps, 1 + eps};
  Physical Volume("foundation") = {plate()};
  Physical Volume("dam left") = {left()};
  Physical Volume("dam right") = {right()};
  left() = Surface In BoundingBox {-5 - eps, -eps, -eps, eps, eps, 1 + eps};
  right() = Surface In BoundingBox {-eps, -eps, -eps, 5 + eps, eps, 1 + eps};
  between() = Surface In BoundingBox {-eps, -eps, -eps, eps, 10 + eps, 1 + eps};
  fixed() = Surface In BoundingBox {-5 - eps, -1 - eps, -eps, 5 + eps, -1 + eps, 1 + eps};
  Physical Surface("joint left base") = {left()};
  Physical Surface("joint right base") = {right()};
  Physical Surface("joint vertical") = {between()};
  Physical Surface("fixed") = {fixed()};
  left() = Curve In BoundingBox {-5 - eps, -eps, -eps, -5 + eps, eps, 1 + eps};
  middle() = Curve In BoundingBox {-eps, -eps, -eps, eps, eps, 1 + eps};
  right() = Curve In BoundingBox {5 - eps, -eps, -eps, 5 + eps, eps, 1 + eps};
  top() = Curve In BoundingBox {-eps, 10 - eps, -eps, eps, 10 + eps, 1 + eps};
  Physical Curve("heel left base") = {left()};
  Physical Curve("toe left base") = {middle()};
  Physical Curve("heel right base") = {middle()};
  Physical Curve("toe right base") = {right()};
  Physical Curve("heel vertical") = {top()};
  Physical Curve("toe vertical") = {middle()};
EndIf
Physical Point("crest") = {6};
