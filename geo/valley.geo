// valley.geo - a 45 m dam across a valley: the joint is the curved surface y = flank (z / half)^2.
// Example of a user's own geometry in 3D: only the names of the physical groups are prescribed.

SetFactory("OpenCASCADE");
Include "../pro/parameters.pro";

half = 60;  // half of the length of the dam [m]
flank = 35;  // height of the rock at the ends of the dam [m]
beside = 40;  // rock beyond the ends [m]
up = 60;  // rock upstream, downstream and below [m]
down = 94;
depth = 60;
h_joint = 34 / n_joint;

// Rock: a profile across the valley, extruded along the river
n = 10;
profile() = {};
wide = half + beside;
For i In {0 : n}
  z = wide * (2 * i / n - 1);
  point = newp;
  Point(point) = {-up, flank * (z / half)^2, z};
  profile() += point;
EndFor
left = newp;
Point(left) = {-up, -depth, -wide};
right = newp;
Point(right) = {-up, -depth, wide};
surface = newc;
Spline(surface) = profile();
Line(surface + 1) = {profile(n), right};
Line(surface + 2) = {right, left};
Line(surface + 3) = {left, profile(0)};
Curve Loop(1) = {surface, surface + 1, surface + 2, surface + 3};
Plane Surface(1) = {1};
rock() = Extrude {up + down, 0, 0} { Surface{1}; };

// Dam: the section, extruded across the valley, less the rock
corner = newp;
Point(corner) = {0, 0, -half};
Point(corner + 1) = {34, 0, -half};
Point(corner + 2) = {5, 45, -half};
Point(corner + 3) = {0, 45, -half};
side = newc;
Line(side) = {corner, corner + 1};
Line(side + 1) = {corner + 1, corner + 2};
Line(side + 2) = {corner + 2, corner + 3};
Line(side + 3) = {corner + 3, corner};
loop = newcl;
Curve Loop(loop) = {side, side + 1, side + 2, side + 3};
section = news;
Plane Surface(section) = {loop};
prism() = Extrude {0, 0, 2 * half} { Surface{section}; };
cut() = BooleanDifference { Volume{prism(1)}; Delete; } { Volume{rock(1)}; };
middle = newp;
Point(middle) = {0, 45, 0};  // of the crest's upstream edge
all() = BooleanFragments { Volume{cut(0)}; Delete; } { Volume{rock(1)}; Point{middle}; Delete; };

// Entities of the physical groups, by shared surfaces and bounding boxes
far = 1000;
eps = 1e-3;
dam = all(0);
foundation = all(1);
dam_skin() = Abs(Boundary { Volume{dam}; });
rock_skin() = Abs(Boundary { Volume{foundation}; });
joint() = {};
For i In {0 : #dam_skin() - 1}
  For k In {0 : #rock_skin() - 1}
    If(dam_skin(i) == rock_skin(k))
      joint() += dam_skin(i);
    EndIf
  EndFor
EndFor
upstream() = Surface In BoundingBox {-eps, -far, -far, eps, far, far};
top() = Surface In BoundingBox {-far, 45 - eps, -far, far, far, far};
ends() = Surface In BoundingBox {-far, -far, -half - eps, far, far, -half + eps};
ends() += Surface In BoundingBox {-far, -far, half - eps, far, far, half + eps};
downstream() = dam_skin();
downstream() -= {joint(), upstream(), top(), ends()};
fixed() = Surface In BoundingBox {-far, -far, -far, -up + eps, far, far};
fixed() += Surface In BoundingBox {down - eps, -far, -far, far, far, far};
fixed() += Surface In BoundingBox {-far, -far, -far, far, -depth + eps, far};
fixed() += Surface In BoundingBox {-far, -far, -far, far, far, -wide + eps};
fixed() += Surface In BoundingBox {-far, -far, wide - eps, far, far, far};
rim() = Abs(Boundary { Surface{joint()}; });
heel() = {};
toe() = {};
For i In {0 : #rim() - 1}
  box() = BoundingBox Curve{rim(i)};
  If(box(3) < eps)
    heel() += rim(i);
  ElseIf(box(5) - box(2) > eps)
    toe() += rim(i);
  EndIf
EndFor
crest() = Point In BoundingBox {-eps, 45 - eps, -eps, eps, 45 + eps, eps};

MeshSize { PointsOf { Volume{foundation}; } } = h_found;
MeshSize { PointsOf { Volume{dam}; } } = h_dam;
MeshSize { PointsOf { Surface{joint()}; } } = h_joint;

Physical Volume("dam") = {dam};
Physical Volume("foundation") = {foundation};
Physical Surface("joint") = {joint()};
Physical Surface("upstream") = {upstream()};
Physical Surface("downstream") = {downstream()};
Physical Surface("crest surface") = {top()};
Physical Surface("fixed") = {fixed()};
Physical Curve("heel") = {heel()};
Physical Curve("toe") = {toe()};
Physical Point("crest") = {crest()};
