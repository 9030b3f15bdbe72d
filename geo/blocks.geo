// blocks.geo - two blocks, 5 m wide and 10 m high, with a vertical joint between them (SSNP143).
// Both stand on a rigid plate: what is fixed must not touch a joint. In 3D (dim = 3) 1 m thick.

SetFactory("OpenCASCADE");
Include "../pro/parameters.pro";

eps = 1e-3;
thin = 1;  // of the plate [m]
Rectangle(1) = {-6, -thin, 0, 12, thin};
Rectangle(2) = {-5, 0, 0, 5, 10};
Rectangle(3) = {0, 0, 0, 5, 10};
If(dim == 2)
  all() = BooleanFragments { Surface{1, 2, 3}; Delete; } {};
  Physical Surface("foundation") = {all(0)};
  Physical Surface("dam left") = {all(1)};
  Physical Surface("dam right") = {all(2)};
  left() = Curve In BoundingBox {-5 - eps, -eps, -eps, eps, eps, eps};
  right() = Curve In BoundingBox {-eps, -eps, -eps, 5 + eps, eps, eps};
  between() = Curve In BoundingBox {-eps, -eps, -eps, eps, 10 + eps, eps};
  fixed() = Curve In BoundingBox {-7, -thin - eps, -eps, 7, -thin + eps, eps};
  Physical Curve("joint left base") = {left()};
  Physical Curve("joint right base") = {right()};
  Physical Curve("joint vertical") = {between()};
  Physical Curve("fixed") = {fixed()};
  ends() = Point In BoundingBox {-5 - eps, -eps, -eps, -5 + eps, eps, eps};
  middle() = Point In BoundingBox {-eps, -eps, -eps, eps, eps, eps};
  right_end() = Point In BoundingBox {5 - eps, -eps, -eps, 5 + eps, eps, eps};
  top() = Point In BoundingBox {-eps, 10 - eps, -eps, eps, 10 + eps, eps};
  Physical Point("heel left base") = {ends()};
  Physical Point("toe left base") = {middle()};
  Physical Point("heel right base") = {middle()};
  Physical Point("toe right base") = {right_end()};
  Physical Point("heel vertical") = {top()};
  Physical Point("toe vertical") = {middle()};
Else
  Extrude {0, 0, 1} { Surface{1, 2, 3}; }
  all() = BooleanFragments { Volume{1, 2, 3}; Delete; } {};
  Physical Volume("foundation") = {all(0)};
  Physical Volume("dam left") = {all(1)};
  Physical Volume("dam right") = {all(2)};
  left() = Surface In BoundingBox {-5 - eps, -eps, -eps, eps, eps, 1 + eps};
  right() = Surface In BoundingBox {-eps, -eps, -eps, 5 + eps, eps, 1 + eps};
  between() = Surface In BoundingBox {-eps, -eps, -eps, eps, 10 + eps, 1 + eps};
  fixed() = Surface In BoundingBox {-7, -thin - eps, -eps, 7, -thin + eps, 1 + eps};
  Physical Surface("joint left base") = {left()};
  Physical Surface("joint right base") = {right()};
  Physical Surface("joint vertical") = {between()};
  Physical Surface("fixed") = {fixed()};
  ends() = Curve In BoundingBox {-5 - eps, -eps, -eps, -5 + eps, eps, 1 + eps};
  middle() = Curve In BoundingBox {-eps, -eps, -eps, eps, eps, 1 + eps};
  right_end() = Curve In BoundingBox {5 - eps, -eps, -eps, 5 + eps, eps, 1 + eps};
  top() = Curve In BoundingBox {-eps, 10 - eps, -eps, eps, 10 + eps, 1 + eps};
  Physical Curve("heel left base") = {ends()};
  Physical Curve("toe left base") = {middle()};
  Physical Curve("heel right base") = {middle()};
  Physical Curve("toe right base") = {right_end()};
  Physical Curve("heel vertical") = {top()};
  Physical Curve("toe vertical") = {middle()};
EndIf
crest() = Point In BoundingBox {5 - eps, 10 - eps, -eps, 5 + eps, 10 + eps, eps};
Physical Point("crest") = {crest()};

points() = Point In BoundingBox {-7, -2, -1, 7, 11, 2};
MeshSize { points() } = h_dam;
points() = Point In BoundingBox {-eps, -eps, -eps, eps, 11, 2};
MeshSize { points() } = 10 / n_joint;
