// monoliths.geo - two blocks of a 45 m dam with a contraction joint between them, on two bases: in
// 2D (dim = 2) an upstream and a downstream block, in 3D two monoliths beside each other along z.
// Example of a user's own geometry with joints that meet: only the names of the physical groups are
// prescribed.

SetFactory("OpenCASCADE");
Include "../pro/parameters.pro";

h_joint = 34 / n_joint;
between = 14;  // 2D: x of the contraction joint [m]
long = 15;  // 3D: length of a monolith along z [m]
far = 1000;
eps = 1e-3;

Rectangle(1) = {-found_side, -found_depth, 0, 34 + 2 * found_side, found_depth};
Point(101) = {0, 0, 0};
Point(102) = {between, 0, 0};
Point(103) = {34, 0, 0};
Point(104) = {between, 45 * (34 - between) / 29, 0};
Point(105) = {5, 45, 0};
Point(106) = {0, 45, 0};
Line(101) = {101, 102};
Line(102) = {102, 104};
Line(103) = {104, 105};
Line(104) = {105, 106};
Line(105) = {106, 101};
Line(106) = {102, 103};
Line(107) = {103, 104};
Curve Loop(101) = {101, 102, 103, 104, 105};
Curve Loop(102) = {106, 107, -102};
Plane Surface(101) = {101};
Plane Surface(102) = {102};
If(dim == 2)
  all() = BooleanFragments { Surface{1, 101, 102}; Delete; } {};
  Physical Surface("foundation") = {all(0)};
  Physical Surface("dam upstream block") = {all(1)};
  Physical Surface("dam downstream block") = {all(2)};
  base() = Curve In BoundingBox {-eps, -eps, -eps, between + eps, eps, eps};
  Physical Curve("joint upstream base") = {base()};
  base() = Curve In BoundingBox {between - eps, -eps, -eps, 34 + eps, eps, eps};
  Physical Curve("joint downstream base") = {base()};
  contraction() = Curve In BoundingBox {between - eps, -eps, -eps, between + eps, far, eps};
  Physical Curve("joint contraction") = {contraction()};
  upstream() = Curve In BoundingBox {-eps, -eps, -eps, eps, 45 + eps, eps};
  Physical Curve("upstream") = {upstream()};
  fixed() = Curve In BoundingBox {-far, -far, -eps, -found_side + eps, far, eps};
  fixed() += Curve In BoundingBox {-far, -far, -eps, far, -found_depth + eps, eps};
  fixed() += Curve In BoundingBox {34 + found_side - eps, -far, -eps, far, far, eps};
  Physical Curve("fixed") = {fixed()};
  heel() = Point In BoundingBox {-eps, -eps, -eps, eps, eps, eps};
  middle() = Point In BoundingBox {between - eps, -eps, -eps, between + eps, eps, eps};
  toe() = Point In BoundingBox {34 - eps, -eps, -eps, 34 + eps, eps, eps};
  top() = Point In BoundingBox {between - eps, 1, -eps, between + eps, far, eps};
  Physical Point("heel upstream base") = {heel()};
  Physical Point("toe upstream base") = {middle()};
  Physical Point("heel downstream base") = {middle()};
  Physical Point("toe downstream base") = {toe()};
  Physical Point("heel contraction") = {middle()};
  Physical Point("toe contraction") = {top()};  // on the downstream face: no water enters there
Else
  section() = BooleanUnion { Surface{101}; Delete; } { Surface{102}; Delete; };
  Extrude {0, 0, 2 * long} { Surface{1}; }
  first() = Extrude {0, 0, long} { Surface{section(0)}; };
  Extrude {0, 0, long} { Surface{first(0)}; }
  rock() = Volume In BoundingBox {-far, -far, -far, far, eps, far};
  near() = Volume In BoundingBox {-eps, -eps, -eps, far, far, long + eps};
  away() = Volume In BoundingBox {-eps, -eps, long - eps, far, far, far};
  all() = BooleanFragments { Volume{rock(0), near(0), away(0)}; Delete; } {};
  Physical Volume("foundation") = {all(0)};
  Physical Volume("dam left") = {all(1)};
  Physical Volume("dam right") = {all(2)};
  left() = Surface In BoundingBox {-eps, -eps, -eps, 34 + eps, eps, long + eps};
  right() = Surface In BoundingBox {-eps, -eps, long - eps, 34 + eps, eps, far};
  contraction() = Surface In BoundingBox {-eps, -eps, long - eps, 34 + eps, far, long + eps};
  Physical Surface("joint left base") = {left()};
  Physical Surface("joint right base") = {right()};
  Physical Surface("joint contraction") = {contraction()};
  upstream() = Surface In BoundingBox {-eps, -eps, -eps, eps, far, far};
  Physical Surface("upstream") = {upstream()};
  fixed() = Surface In BoundingBox {-far, -far, -far, -found_side + eps, far, far};
  fixed() += Surface In BoundingBox {-far, -far, -far, far, -found_depth + eps, far};
  fixed() += Surface In BoundingBox {34 + found_side - eps, -far, -far, far, far, far};
  Physical Surface("fixed") = {fixed()};
  heel_left() = Curve In BoundingBox {-eps, -eps, -eps, eps, eps, long + eps};
  heel_right() = Curve In BoundingBox {-eps, -eps, long - eps, eps, eps, far};
  toe_left() = Curve In BoundingBox {34 - eps, -eps, -eps, 34 + eps, eps, long + eps};
  toe_right() = Curve In BoundingBox {34 - eps, -eps, long - eps, 34 + eps, eps, far};
  heel_between() = Curve In BoundingBox {-eps, -eps, long - eps, eps, far, long + eps};
  skin() = Abs(Boundary { Surface{contraction()}; });
  top() = Curve In BoundingBox {-eps, 45 - eps, long - eps, far, far, long + eps};
  bottom() = Curve In BoundingBox {-eps, -eps, long - eps, far, eps, long + eps};
  skin() -= {heel_between(), top(), bottom()};
  Physical Curve("heel left base") = {heel_left()};
  Physical Curve("toe left base") = {toe_left()};
  Physical Curve("heel right base") = {heel_right()};
  Physical Curve("toe right base") = {toe_right()};
  Physical Curve("heel contraction") = {heel_between()};
  Physical Curve("toe contraction") = {skin()};
EndIf
crest() = Point In BoundingBox {-eps, 45 - eps, -eps, eps, 45 + eps, eps};
Physical Point("crest") = {crest()};

points() = Point In BoundingBox {-far, -far, -far, far, far, far};
MeshSize { points() } = h_found;
points() = Point In BoundingBox {-eps, eps, -eps, 34 + eps, far, far};
MeshSize { points() } = h_dam;
points() = Point In BoundingBox {-eps, -eps, -eps, 34 + eps, eps, far};
MeshSize { points() } = h_joint;
