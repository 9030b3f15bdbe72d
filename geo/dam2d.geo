// dam2d.geo - plane mesh of dam, foundation and joint.
//
// One conforming mesh: the joint is a line of ordinary elements; its two faces are two function
// spaces on the same nodes (pro/spaces.pro). Element sizes grow with the distance from the joint.
//
// Takes     the section: pro/section.pro; parameters of the mesh; lift_drain_x(j - 1): distance of
//           the drains from the heel of joint j > 0, 0 if it has none; node_points: 1 if the nodes
//           of joints that store water are to be points, for pro/flow_in_time.pro
// Provides  physical groups (in 3D by dam3d.geo): the bodies, joints with their heels and toes,
//           crest, fixed boundary, faces SEGMENT + i, line forces mark_region(k)
//           for dam3d.geo: surfaces dam(j) above joint j, foundation(), lower(); side_names(); of
//           joint j: numbers of elements all_first(j), beyond the drains all_rest(j) (0: no
//           drains), place of the drains drain_point_x(j), drain_point_y(j)

Include "../pro/parameters.pro";

// Tags of the point and the curve at the drains of the first joint, of the surface of the dam above
// it, and of those above joint j > 0: FIRST_LIFT + j
DRAIN_TAG = 100;
DAM_SURFACE = 1;
FIRST_LIFT = 100;
// Of points and curves at the nodes of the joints, from here on
AT_NODES = 100000;
DefineConstant[ node_points = 0 ];
with_points = (node_points && time_unit > 0 && dim == 2);
If(with_points && !StrCmp(mesh_pattern, "regular"))
  Error("mesh_pattern = regular: must be free with time_unit in Gmsh and GetDP alone");
EndIf

h_joint = joint_length / n_joint;
regular = !StrCmp(mesh_pattern, "regular");

If(!Exists(lift_drain_x))
  lift_drain_x() = {};
  For j In {1 : top}
    lift_drain_x() += 0;
  EndFor
EndIf
all_first() = {};
all_rest() = {};
first_curve() = {};
last_curve() = {};
drain_point() = {};
drain_point_x() = {};
drain_point_y() = {};
known_x() = {};
known_y() = {};
known_point() = {};
For j In {0 : top}
  dx = all_toe_x(j) - all_heel_x(j);
  dy = all_toe_y(j) - all_heel_y(j);
  length = Sqrt[dx^2 + dy^2];
  number = all_elements(j);
  drains_at = drained ? drain_x : 0;
  If(j > 0)
    drains_at = lift_drain_x(j - 1);
  EndIf
  heel = newp;
  Point(heel) = {all_heel_x(j), all_heel_y(j), 0, h_joint};
  toe = newp;
  Point(toe) = {all_toe_x(j), all_toe_y(j), 0, h_joint};
  n_first = number;
  n_rest = 0;
  drain_point_x() += all_heel_x(j) + dx * drains_at / length;
  drain_point_y() += all_heel_y(j) + dy * drains_at / length;
  middle = toe;
  If(drains_at > 0)  // a node at the drains: two curves
    n_first = Round(number * drains_at / length);
    n_first = (n_first < number) ? n_first : number - 1;
    n_first = (n_first < 1) ? 1 : n_first;
    n_rest = (n_first < number) ? number - n_first : 1;
    If(!with_points)
      middle = (j == 0) ? DRAIN_TAG : newp;
      Point(middle) = {drain_point_x(j), drain_point_y(j), 0, h_joint};
    EndIf
  EndIf
  all_first() += n_first;
  all_rest() += n_rest;
  drain_point() += middle;
  If(with_points)
    line = AT_NODES * (1 + j) + 1;
    from = heel;
    first_part = (n_rest > 0) ? drains_at / length : 1;
    number = n_first + n_rest;
    For k In {1 : number}
      point = (k < number) ? line + k : toe;
      If(k < number)
        part = (k <= n_first) ? first_part * k / n_first
                              : 1 - (1 - first_part) * (number - k) / n_rest;
        Point(point) = {all_heel_x(j) + dx * part, all_heel_y(j) + dy * part, 0, h_joint};
      EndIf
      Line(line + k - 1) = {from, point};
      Transfinite Curve {line + k - 1} = 2;
      from = point;
    EndFor
    last_curve() += line + number - 1;
  Else
    line = newl;
    Line(line) = {heel, middle};
    Transfinite Curve {line} = n_first + 1;
    last_curve() += line;
  EndIf
  first_curve() += line;
  known_x() += {all_heel_x(j), all_toe_x(j)};
  known_y() += {all_heel_y(j), all_toe_y(j)};
  known_point() += {heel, toe};
EndFor

side_names() = Str["upstream face", "downstream face", "crest surface", "reservoir floor",
                   "tailwater bed"];

// Segments of the faces, divided at the marks: the curves of segment i are pieces() from
// piece_start(i) to piece_start(i + 1) - 1.
mark_point() = {};
For k In {1 : #mark_x()}
  mark_point() += 0;
EndFor
pieces() = {};
piece_start() = {0};
For i In {0 : #seg_side() - 1}
  // end points: the marks in their order along the segment, then its end
  dx = seg_x1(i) - seg_x0(i);
  dy = seg_y1(i) - seg_y0(i);
  before = (regular && seg_side(i) >= FLOOR) ? 1 : 0;  // divided below
  from = 0;
  For stop In {0 : #mark_x() + 1}
    share = (stop == 0) ? 0 : 1;
    For k In {0 : #mark_x() - 1}
      mark_share = ((mark_x(k) - seg_x0(i)) * dx + (mark_y(k) - seg_y0(i)) * dy) / (dx^2 + dy^2);
      // within rounding of a corner: at the corner
      If(stop > 0 && mark_segment(k) == i &&
          mark_share > before + 1e-9 && mark_share < share - 1e-9)
        share = mark_share;
      EndIf
    EndFor
    If(before < 1)
      // exactly, at a corner: it is compared by its coordinates
      x = (share == 1) ? seg_x1(i) : seg_x0(i) + share * dx;
      y = (share == 1) ? seg_y1(i) : seg_y0(i) + share * dy;
      point = 0;
      For k In {0 : #known_point() - 1}
        If((known_x(k) - x)^2 + (known_y(k) - y)^2 < (1e-9 * dam_height)^2)
          point = known_point(k);
        EndIf
      EndFor
      If(point == 0)
        point = newp;
        // linear to h_dam at the crest, and to h_found at the depth of the foundation
        h = (seg_side(i) >= FLOOR && (x < 0 || x > dam_base)) ? h_found :
            (seg_body(i) != UNDER) ?
            h_joint + (h_dam - h_joint) * (y - heel_y) / (dam_height - heel_y) :
            h_joint + (h_found - h_joint) * (heel_y - y) / (heel_y + found_depth);
        Point(point) = {x, y, 0, (h < h_joint && seg_side(i) < FLOOR) ? h_joint : h};
        known_x() += x;
        known_y() += y;
        known_point() += point;
      EndIf
      For k In {0 : #mark_x() - 1}
        If((mark_x(k) - x)^2 + (mark_y(k) - y)^2 < (1e-9 * dam_height)^2)
          mark_point(k) = point;
        EndIf
      EndFor
      If(stop > 0)
        line = newl;
        Line(line) = {from, point};
        pieces() += line;
      EndIf
      from = point;
      before = share;
    EndIf
  EndFor
  piece_start() += #pieces();
EndFor

// Curves of joint j: joint_curves() from joint_start(j) to joint_start(j + 1) - 1, heel to toe
joint_curves() = {};
joint_start() = {0};
For j In {0 : top}
  joint_curves() += {first_curve(j) : last_curve(j)};
  If(all_rest(j) > 0 && !with_points)
    line = (j == 0) ? DRAIN_TAG : newl;
    Line(line) = {drain_point(j), known_point(2 * j + 1)};
    Transfinite Curve {line} = all_rest(j) + 1;
    joint_curves() += line;
  EndIf
  joint_start() += #joint_curves();
EndFor
joint_back() = {};  // the first joint, from toe to heel
For k In {1 : joint_start(1)}
  joint_back() += -joint_curves(joint_start(1) - k);
EndFor

// Bodies above joint j: along it, downstream, back along joint j + 1, upstream
dam() = {};
For j In {0 : top}
  around() = {};
  For k In {joint_start(j) : joint_start(j + 1) - 1}
    around() += joint_curves(k);
  EndFor
  below_next = (j < top);
  For i In {0 : #seg_side() - 1}
    If(seg_body(i) == UPPER + j)
      If(below_next && seg_side(i) == UP)
        below_next = 0;
        For k In {1 : joint_start(j + 2) - joint_start(j + 1)}
          around() += -joint_curves(joint_start(j + 2) - k);
        EndFor
      EndIf
      For k In {piece_start(i) : piece_start(i + 1) - 1}
        around() += pieces(k);
      EndFor
    EndIf
  EndFor
  body = (j == 0) ? DAM_SURFACE : FIRST_LIFT + j;
  Curve Loop(body) = {around()};
  Plane Surface(body) = {body};
  dam() += body;
EndFor
// Lower body: the concrete below a lift joint, bonded to the foundation, and the foundation
under() = {};
surface_left() = {};  // surface of the rock, upstream
surface_right() = {};  // and downstream
For i In {0 : #seg_side() - 1}
  For k In {piece_start(i) : piece_start(i + 1) - 1}
    If(seg_side(i) == FLOOR)
      surface_left() += pieces(k);
    ElseIf(seg_side(i) == BED)
      surface_right() += pieces(k);
    ElseIf(seg_body(i) == UNDER)
      under() += pieces(k);
    EndIf
  EndFor
EndFor
lower() = {};
base_back() = {joint_back()};
base_points() = {known_point(0), known_point(1)};
If(lift)
  For k In {0 : #known_point() - 1}
    If(known_x(k) == 0 && known_y(k) == 0)
      base_points(0) = known_point(k);
    ElseIf(known_x(k) == dam_base && known_y(k) == 0)
      base_points(1) = known_point(k);
    EndIf
  EndFor
  base = newl;
  Line(base) = {base_points(0), base_points(1)};
  base_back() = {-base};
EndIf

If(!regular)
  left = newp;
  Point(left) = {-found_side, -found_depth, 0, h_found};
  right = newp;
  Point(right) = {dam_base + found_side, -found_depth, 0, h_found};
  corner_left = 0;
  corner_right = 0;
  For k In {0 : #known_point() - 1}
    If(known_x(k) < 0 && known_x(k) == -found_side)
      corner_left = known_point(k);
    ElseIf(known_x(k) == dam_base + found_side)
      corner_right = known_point(k);
    EndIf
  EndFor
  side = newl;
  Line(side) = {corner_left, left};
  Line(side + 1) = {left, right};
  Line(side + 2) = {right, corner_right};
  fixed() = {side, side + 1, side + 2};
  rock = 2;
  Curve Loop(rock) = {surface_left(), fixed(), surface_right(), base_back()};
  Plane Surface(rock) = {rock};
  foundation() = {rock};
  If(lift)
    below_lift = 3;
    Curve Loop(below_lift) = {base, under(), joint_back()};
    Plane Surface(below_lift) = {below_lift};
    lower() = {below_lift};
  EndIf
Else
  // Quadrangles in the dam, below and beside it; coarse triangles at the sides of the foundation,
  // where the stress is almost uniform
  n_dam = Ceil(9 * n_joint / 50);
  n_depth = Ceil(7 * n_joint / 50);
  n_side = Ceil(5 * n_joint / 50);
  side = 0.5 * found_side;  // width of the quadrangles beside the joint
  heel = known_point(0);
  toe = known_point(1);
  // Points: on the surface of the rock and, below, on its base, from upstream to downstream. The
  // tags follow those of the dam; a point and a curve at the drains have DRAIN_TAG.
  floor_end = 5;
  floor_middle = 11;
  bed_middle = 13;
  bed_end = 8;
  base_left = 6;
  base_floor = 12;
  base_heel = 9;
  base_toe = 10;
  base_bed = 14;
  base_right = 7;
  Point(floor_end) = {-found_side, 0, 0, h_found};
  Point(base_left) = {-found_side, -found_depth, 0, h_found};
  Point(base_right) = {dam_base + found_side, -found_depth, 0, h_found};
  Point(bed_end) = {dam_base + found_side, base_toe_y, 0, h_found};
  Point(base_heel) = {0, -found_depth, 0, h_found};
  Point(base_toe) = {dam_base, -found_depth, 0, h_found};
  Point(floor_middle) = {-side, 0, 0, h_found};
  Point(base_floor) = {-side, -found_depth, 0, h_found};
  Point(bed_middle) = {dam_base + side, base_toe_y, 0, h_found};
  Point(base_bed) = {dam_base + side, -found_depth, 0, h_found};
  // Curves around the rock, from the heel upstream and back to the toe; then those across it
  floor_near = 5;
  floor_far = 6;
  left_side = 7;
  base_1 = 8;
  base_2 = 9;
  base_3 = 10;
  base_4 = 11;
  base_5 = 12;
  right_side = 13;
  bed_far = 14;
  bed_near = 15;
  below_heel = 16;
  below_toe = 17;
  below_floor = 18;
  below_bed = 19;
  Line(floor_near) = {heel, floor_middle};
  Line(floor_far) = {floor_middle, floor_end};
  Line(left_side) = {floor_end, base_left};
  Line(base_1) = {base_left, base_floor};
  Line(base_2) = {base_floor, base_heel};
  Line(base_3) = {base_heel, base_toe};
  Line(base_4) = {base_toe, base_bed};
  Line(base_5) = {base_bed, base_right};
  Line(right_side) = {base_right, bed_end};
  Line(bed_far) = {bed_end, bed_middle};
  Line(bed_near) = {bed_middle, toe};
  Line(below_heel) = {heel, base_heel};
  Line(below_toe) = {toe, base_toe};
  Line(below_floor) = {floor_middle, base_floor};
  Line(below_bed) = {bed_middle, base_bed};
  // The dam's faces, from the toe: downstream, crest, upstream
  downstream = 2;
  crest_line = 3;
  upstream = 4;
  Transfinite Curve {crest_line, base_3} = all_first(0) + all_rest(0) + 1;
  Transfinite Curve {downstream, -upstream} = n_dam + 1 Using Progression 1.25 ^ (9 / n_dam);
  Transfinite Curve {below_heel, below_toe, below_floor, below_bed}
    = n_depth + 1 Using Progression 1.5 ^ (7 / n_depth);
  Transfinite Curve {floor_near, -base_2, -bed_near, base_4}
    = n_side + 1 Using Progression 1.5 ^ (5 / n_side);
  Transfinite Curve {floor_far, base_1, base_5, bed_far} = Ceil(n_joint / 50) + 1;
  Transfinite Curve {left_side, right_side} = Ceil(2 * n_joint / 50) + 1;
  // Rock below the dam, beside it upstream and downstream, and at the sides
  rock_below = 2;
  rock_left = 3;
  rock_right = 4;
  side_left = 5;
  side_right = 6;
  Curve Loop(rock_below) = {below_heel, base_3, -below_toe, joint_back()};
  Curve Loop(rock_left) = {floor_near, below_floor, base_2, -below_heel};
  Curve Loop(rock_right) = {below_toe, base_4, -below_bed, bed_near};
  Curve Loop(side_left) = {floor_far, left_side, base_1, -below_floor};
  Curve Loop(side_right) = {below_bed, base_5, right_side, bed_far};
  For k In {rock_below : side_right}
    Plane Surface(k) = {k};
  EndFor
  quadrangles() = {dam(0), rock_below, rock_left, rock_right};
  If(drained)  // bounded by five curves: the corners are given
    Transfinite Surface {dam(0)} = {heel, toe, known_point(2), known_point(3)};
    Transfinite Surface {rock_below} = {heel, base_heel, base_toe, toe};
    Transfinite Surface {rock_left, rock_right};
  Else
    Transfinite Surface {quadrangles()};
  EndIf
  Recombine Surface {quadrangles()};
  foundation() = {rock_below : side_right};
  fixed() = {left_side, base_1, base_2, base_3, base_4, base_5, right_side};
  surface_left() = {floor_near, floor_far};
  surface_right() = {bed_far, bed_near};
EndIf

// Between several joints: element sizes by the distance from the nearest one, not below that of
// the joint (MathEval reads no negative factor)
If(top > 0)
  Field[1] = Distance;
  Field[1].CurvesList = {joint_curves()};
  Field[1].Sampling = 10 * n_joint;
  Field[2] = MathEval;
  per_metre = (h_dam > h_joint) ? (h_dam - h_joint) / dam_height : 0;
  Field[2].F = Sprintf("%.16g + %.16g * F1", h_joint, per_metre);
  Background Field = 2;
  Mesh.MeshSizeExtendFromBoundary = 0;
  Mesh.MeshSizeFromPoints = 0;
EndIf

If(dim == 2)
  For j In {0 : top}
    suffix = "";
    If(j > 0)
      suffix = Sprintf(" %g", j + 1);
    EndIf
    curves() = {};
    For k In {joint_start(j) : joint_start(j + 1) - 1}
      curves() += joint_curves(k);
    EndFor
    Physical Surface(StrCat("dam", suffix), DAM + j * LAYER) = {dam(j)};
    Physical Curve(StrCat("joint", suffix), JOINT + j * LAYER) = {curves()};
    Physical Point(StrCat("heel", suffix), HEEL + j * LAYER) = {known_point(2 * j)};
    Physical Point(StrCat("toe", suffix), TOE + j * LAYER) = {known_point(2 * j + 1)};
    If(with_points)
      inner() = {first_curve(j) + 1 : last_curve(j)};
      Physical Point(NODES + j * LAYER) = {known_point(2 * j), inner(), known_point(2 * j + 1)};
    EndIf
  EndFor
  Physical Surface("foundation", FOUNDATION) = {foundation()};
  Physical Surface("lower dam", LOWER) = {lower()};
  Physical Curve("fixed", FIXED) = {fixed()};
  For k In {0 : #known_point() - 1}
    If(known_x(k) == batter && known_y(k) == dam_height)
      Physical Point("crest", CREST) = {known_point(k)};
    EndIf
  EndFor
  For k In {0 : #mark_point() - 1}
    Physical Point(mark_region(k)) = {mark_point(k)};
  EndFor
  For i In {0 : #seg_side() - 1}
    segment_curves() = {};
    If(seg_side(i) == FLOOR)
      segment_curves() += surface_left();
    ElseIf(seg_side(i) == BED)
      segment_curves() += surface_right();
    Else
      For k In {piece_start(i) : piece_start(i + 1) - 1}
        segment_curves() += pieces(k);
      EndFor
    EndIf
    name = StrCat(Str(side_names(seg_side(i))), Sprintf(" %g", i));
    Physical Curve(Str(name), SEGMENT + i) = {segment_curves()};
  EndFor
EndIf
