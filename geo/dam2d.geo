// dam2d.geo - the plane scene: dam, foundation and the joint between them (y = 0, 0 <= x <=
// dam_base). One conforming mesh: the joint is a line of ordinary elements, the two lips are two
// function spaces on the same nodes (pro/spaces.pro). Sizes grow from the joint outwards.

Include "../pro/parameters.pro";

h_joint = dam_base / n_joint;
regular = !StrCmp(mesh_pattern, "regular");

Point(1) = {0, 0, 0, h_joint};  // heel
Point(2) = {dam_base, 0, 0, h_joint};  // toe
Point(3) = {dam_crest, dam_height, 0, h_dam};
Point(4) = {0, dam_height, 0, h_dam};
Point(5) = {-found_side, 0, 0, h_found};
Point(6) = {-found_side, -found_depth, 0, h_found};
Point(7) = {dam_base + found_side, -found_depth, 0, h_found};
Point(8) = {dam_base + found_side, 0, 0, h_found};

Line(1) = {1, 2};  // joint
Line(2) = {2, 3};  // downstream face
Line(3) = {3, 4};  // crest
Line(4) = {4, 1};  // upstream face
Transfinite Curve {1} = n_joint + 1;

Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
dam() = {1};

If(!regular)
  Line(5) = {1, 5};
  Line(6) = {5, 6};
  Line(7) = {6, 7};
  Line(8) = {7, 8};
  Line(9) = {8, 2};
  Curve Loop(2) = {5, 6, 7, 8, 9, -1};
  Plane Surface(2) = {2};
  foundation() = {2};
  fixed() = {6, 7, 8};
Else
  // Quadrangles in the dam, under it and beside it; a few coarse triangles at the far sides, where
  // the stress is almost uniform.
  n_dam = Ceil(9 * n_joint / 50);
  n_depth = Ceil(7 * n_joint / 50);
  n_side = Ceil(5 * n_joint / 50);
  side = 0.5 * found_side;  // width of the quadrangles beside the joint
  Point(9) = {0, -found_depth, 0, h_found};
  Point(10) = {dam_base, -found_depth, 0, h_found};
  Point(11) = {-side, 0, 0, h_found};
  Point(12) = {-side, -found_depth, 0, h_found};
  Point(13) = {dam_base + side, 0, 0, h_found};
  Point(14) = {dam_base + side, -found_depth, 0, h_found};
  Line(5) = {1, 11};
  Line(6) = {11, 5};
  Line(7) = {5, 6};
  Line(8) = {6, 12};
  Line(9) = {12, 9};
  Line(10) = {9, 10};
  Line(11) = {10, 14};
  Line(12) = {14, 7};
  Line(13) = {7, 8};
  Line(14) = {8, 13};
  Line(15) = {13, 2};
  Line(16) = {1, 9};
  Line(17) = {2, 10};
  Line(18) = {11, 12};
  Line(19) = {13, 14};
  Transfinite Curve {3, 10} = n_joint + 1;
  Transfinite Curve {2, -4} = n_dam + 1 Using Progression 1.25 ^ (9 / n_dam);
  Transfinite Curve {16, 17, 18, 19} = n_depth + 1 Using Progression 1.5 ^ (7 / n_depth);
  Transfinite Curve {5, -9, -15, 11} = n_side + 1 Using Progression 1.5 ^ (5 / n_side);
  Transfinite Curve {6, 8, 12, 14} = Ceil(n_joint / 50) + 1;
  Transfinite Curve {7, 13} = Ceil(2 * n_joint / 50) + 1;
  Curve Loop(2) = {16, 10, -17, -1};
  Curve Loop(3) = {5, 18, 9, -16};
  Curve Loop(4) = {17, 11, -19, 15};
  Curve Loop(5) = {6, 7, 8, -18};
  Curve Loop(6) = {19, 12, 13, 14};
  Plane Surface(2) = {2};
  Plane Surface(3) = {3};
  Plane Surface(4) = {4};
  Plane Surface(5) = {5};
  Plane Surface(6) = {6};
  Transfinite Surface {1:4};
  Recombine Surface {1:4};
  foundation() = {2:6};
  fixed() = {7, 8, 9, 10, 11, 12, 13};
EndIf

If(dim == 2)
  Physical Surface("dam", DAM) = dam();
  Physical Surface("foundation", FOUNDATION) = foundation();
  Physical Curve("joint", JOINT) = {1};
  Physical Curve("upstream face", UPSTREAM) = {4};
  Physical Curve("downstream face", DOWNSTREAM) = {2};
  Physical Curve("fixed", FIXED) = fixed();
  Physical Point("heel", HEEL) = {1};
  Physical Point("toe", TOE) = {2};
  Physical Point("crest", CREST) = {4};
EndIf
