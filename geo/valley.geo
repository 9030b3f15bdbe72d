// valley.geo - a 45 m dam across a valley: the joint is the curved surface y = flank (z / half)^2.
// Example of a user's own geometry in 3D: only the names of the physical groups are prescribed.
// With contraction_spacing > 0 (geo/valley_blocks.geo) contraction joints divide the dam into
// blocks: "dam block k" on "joint base k", "joint contraction k" between it and block k + 1.

SetFactory("OpenCASCADE");
Include "../pro/parameters.pro";

DefineConstant[ contraction_spacing = 0 ];  // of the contraction joints along z, 0: none [m]
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

// Dam: the section, extruded across the valley block by block, less the rock
length = contraction_spacing ? contraction_spacing : 2 * half;
n_blocks = Ceil[2 * half / length - 1e-9];
blocks() = {};
For k In {0 : n_blocks - 1}
  start = k * length - half;
  end = (k == n_blocks - 1) ? half : start + length;
  corner = newp;
  Point(corner) = {0, 0, start};
  Point(corner + 1) = {34, 0, start};
  Point(corner + 2) = {5, 45, start};
  Point(corner + 3) = {0, 45, start};
  side = newc;
  Line(side) = {corner, corner + 1};
  Line(side + 1) = {corner + 1, corner + 2};
  Line(side + 2) = {corner + 2, corner + 3};
  Line(side + 3) = {corner + 3, corner};
  loop = newcl;
  Curve Loop(loop) = {side, side + 1, side + 2, side + 3};
  section = news;
  Plane Surface(section) = {loop};
  prism() = Extrude {0, 0, end - start} { Surface{section}; };
  cut() = BooleanDifference { Volume{prism(1)}; Delete; } { Volume{rock(1)}; };
  blocks() += cut(0);
EndFor
middle = newp;
Point(middle) = {0, 45, 0};  // of the crest's upstream edge
all() = BooleanFragments { Volume{blocks()}; Delete; } { Volume{rock(1)}; Point{middle}; Delete; };

// Entities of the physical groups, by shared surfaces and bounding boxes
far = 1000;
eps = 1e-3;
blocks() = all({0 : n_blocks - 1});
foundation = all(n_blocks);
rock_skin() = Abs(Boundary { Volume{foundation}; });
upstream() = Surface In BoundingBox {-eps, -far, -far, eps, far, far};
top() = Surface In BoundingBox {-far, 45 - eps, -far, far, far, far};
ends() = Surface In BoundingBox {-far, -far, -half - eps, far, far, -half + eps};
ends() += Surface In BoundingBox {-far, -far, half - eps, far, far, half + eps};
fixed() = Surface In BoundingBox {-far, -far, -far, -up + eps, far, far};
fixed() += Surface In BoundingBox {down - eps, -far, -far, far, far, far};
fixed() += Surface In BoundingBox {-far, -far, -far, far, -depth + eps, far};
fixed() += Surface In BoundingBox {-far, -far, -far, far, far, -wide + eps};
fixed() += Surface In BoundingBox {-far, -far, wide - eps, far, far, far};
crest() = Point In BoundingBox {-eps, 45 - eps, -eps, eps, 45 + eps, eps};

downstream() = Abs(CombinedBoundary { Volume{blocks()}; });
downstream() -= {rock_skin(), upstream(), top(), ends()};

// The blocks and their bases
joint() = {};
For k In {0 : n_blocks - 1}
  skin() = Abs(Boundary { Volume{blocks(k)}; });
  base() = {};
  For i In {0 : #skin() - 1}
    For j In {0 : #rock_skin() - 1}
      If(skin(i) == rock_skin(j))
        base() += skin(i);
      EndIf
    EndFor
  EndFor
  rim() = Abs(Boundary { Surface{base()}; });
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
  block = "";
  own = "";
  If(contraction_spacing)
    block = Sprintf(" block %g", k + 1);
    own = Sprintf(" base %g", k + 1);
  EndIf
  Physical Volume(StrCat("dam", block)) = {blocks(k)};
  Physical Surface(StrCat("joint", own)) = {base()};
  Physical Curve(StrCat("heel", own)) = {heel()};
  Physical Curve(StrCat("toe", own)) = {toe()};
  joint() += base();
EndFor

// The contraction joints: plane sections, from the upstream to the downstream face
edges() = Abs(Boundary { Surface{joint()}; });
For k In {1 : n_blocks - 1}
  z = k * length - half;
  section() = Surface In BoundingBox {-eps, -far, z - eps, far, far, z + eps};
  heel() = Curve In BoundingBox {-eps, -far, z - eps, eps, far, z + eps};
  toe() = Abs(Boundary { Surface{section()}; });
  highest() = Curve In BoundingBox {-eps, 45 - eps, z - eps, far, far, z + eps};
  toe() -= {heel(), highest(), edges()};
  Physical Surface(Sprintf("joint contraction %g", k)) = {section()};
  Physical Curve(Sprintf("heel contraction %g", k)) = {heel()};
  Physical Curve(Sprintf("toe contraction %g", k)) = {toe()};
EndFor

MeshSize { PointsOf { Volume{foundation}; } } = h_found;
MeshSize { PointsOf { Volume{blocks()}; } } = h_dam;
MeshSize { PointsOf { Surface{joint()}; } } = h_joint;

Physical Volume("foundation") = {foundation};
Physical Surface("upstream") = {upstream()};
Physical Surface("downstream") = {downstream()};
Physical Surface("crest surface") = {top()};
Physical Surface("fixed") = {fixed()};
Physical Point("crest") = {crest()};
