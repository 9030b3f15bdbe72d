// dam3d.geo - the section of dam2d.geo extruded along z over the thickness.
//
// mesh_pattern free: tetrahedra; layers: prisms; split: prisms cut into tetrahedra; regular:
// hexahedra (and some prisms). The joint is always a grid of n_joint x n_layers rectangles, each of
// two triangles with tetrahedra.

Include "dam2d.geo";

sections() = {dam(), foundation(), lower()};
If(!StrCmp(mesh_pattern, "free"))
  Extrude {0, 0, thickness} { Surface{sections()}; }
ElseIf(!StrCmp(mesh_pattern, "split"))
  Extrude {0, 0, thickness} { Surface{sections()}; Layers{n_layers}; }
Else
  Extrude {0, 0, thickness} { Surface{sections()}; Layers{n_layers}; Recombine; }
EndIf

// Entities of the extruded segments are selected by bounding boxes with a margin eps; far: beyond
// the mesh
far = 2 * (dam_base + dam_crest + 2 * found_side + found_depth + dam_height + thickness);
eps = 1e-7 * far;
end_x = dam_base + found_side;

// around(): the surfaces extruded from the segment from (x0, y0) to (x1, y1)
Macro Around
  x_min = (x0 < x1) ? x0 : x1;
  y_min = (y0 < y1) ? y0 : y1;
  x_max = x0 + x1 - x_min;
  y_max = y0 + y1 - y_min;
  around() = Surface In BoundingBox {x_min - eps, y_min - eps, -eps,
                                     x_max + eps, y_max + eps, thickness + eps};
  flat() = Surface In BoundingBox {-far, -far, -eps, far, far, eps};
  around() -= flat();
  flat() = Surface In BoundingBox {-far, -far, thickness - eps, far, far, far};
  around() -= flat();
Return

left() = Surface In BoundingBox {-far, -far, -far, -found_side + eps, far, far};
bottom() = Surface In BoundingBox {-far, -far, -far, far, -found_depth + eps, far};
right() = Surface In BoundingBox {end_x - eps, -far, -far, far, far, far};
back() = Surface In BoundingBox {-far, -far, -eps, far, far, eps};
front() = Surface In BoundingBox {-far, -far, thickness - eps, far, far, far};
// Surfaces of joint j: joints() from joint_surface(j) to joint_surface(j + 1) - 1; heels and toes
// likewise
joints() = {};
heels() = {};
toes() = {};
joint_surface() = {0};
heel_curve() = {0};
toe_curve() = {0};
For j In {0 : top}
  x0 = all_heel_x(j);
  y0 = all_heel_y(j);
  x1 = all_toe_x(j);
  y1 = all_toe_y(j);
  Call Around;
  joint() = {around()};
  // without faces that lie in its box: below the heel or the toe of a joint that is inclined
  For i In {0 : #seg_side() - 1}
    If(seg_x0(i) > x_min - eps && seg_x0(i) < x_max + eps
       && seg_x1(i) > x_min - eps && seg_x1(i) < x_max + eps
       && seg_y0(i) > y_min - eps && seg_y0(i) < y_max + eps
       && seg_y1(i) > y_min - eps && seg_y1(i) < y_max + eps)
      x0 = seg_x0(i);
      y0 = seg_y0(i);
      x1 = seg_x1(i);
      y1 = seg_y1(i);
      Call Around;
      joint() -= {around()};
      x0 = all_heel_x(j);
      y0 = all_heel_y(j);
      x1 = all_toe_x(j);
      y1 = all_toe_y(j);
      Call Around;
    EndIf
  EndFor
  heel() = Curve In BoundingBox {x0 - eps, y0 - eps, -eps, x0 + eps, y0 + eps, thickness + eps};
  toe() = Curve In BoundingBox {x1 - eps, y1 - eps, -eps, x1 + eps, y1 + eps, thickness + eps};
  If(!StrCmp(mesh_pattern, "free"))
    joint_skin() = Boundary { Surface{joint()}; };
    joint_skin() -= {heel(), toe()};
    If(all_rest(j) > 0)
      x1 = drain_point_x(j);
      y1 = drain_point_y(j);
      Call Around;
      drain_line() = Curve In BoundingBox {x1 - eps, y1 - eps, -eps, x1 + eps, y1 + eps,
                                           thickness + eps};
      first() = Boundary { Surface{around()}; };
      first() -= {heel(), drain_line()};
      joint_skin() -= {first(), drain_line()};
      Transfinite Curve {first()} = all_first(j) + 1;
      Transfinite Curve {joint_skin()} = all_rest(j) + 1;
      Transfinite Curve {drain_line()} = n_layers + 1;
    Else
      Transfinite Curve {joint_skin()} = all_first(j) + 1;
    EndIf
    Transfinite Curve {heel(), toe()} = n_layers + 1;
    Transfinite Surface {joint()};
  EndIf
  joints() += joint();
  heels() += heel();
  toes() += toe();
  joint_surface() += #joints();
  heel_curve() += #heels();
  toe_curve() += #toes();
EndFor
If(top > 0)
  Field[1].SurfacesList = {joints()};
EndIf

// Volumes, by the plane surface that each was extruded from
bodies() = Volume In BoundingBox {-far, -far, -far, far, far, far};
dam_volume() = {};
dam_joint() = {};  // the joint below each of them
foundation_volume() = {};
lower_volume() = {};
For k In {0 : #bodies() - 1}
  skin() = Boundary { Volume{bodies(k)}; };
  kind = FOUNDATION;
  For j In {0 : #skin() - 1}
    For n In {0 : top}
      kind = (Fabs(skin(j)) == dam(n)) ? DAM + n * LAYER : kind;
    EndFor
    For n In {1 : #lower()}
      kind = (Fabs(skin(j)) == lower(n - 1)) ? LOWER : kind;
    EndFor
  EndFor
  If(kind == DAM || kind > LAYER)
    dam_volume() += bodies(k);
    dam_joint() += (kind - DAM) / LAYER;
  ElseIf(kind == LOWER)
    lower_volume() += bodies(k);
  Else
    foundation_volume() += bodies(k);
  EndIf
EndFor

For j In {0 : top}
  suffix = "";
  If(j > 0)
    suffix = Sprintf(" %g", j + 1);
  EndIf
  own() = {};
  For k In {0 : #dam_volume() - 1}
    If(dam_joint(k) == j)
      own() += dam_volume(k);
    EndIf
  EndFor
  Physical Volume(StrCat("dam", suffix), DAM + j * LAYER) = {own()};
  own() = {};
  For k In {joint_surface(j) : joint_surface(j + 1) - 1}
    own() += joints(k);
  EndFor
  Physical Surface(StrCat("joint", suffix), JOINT + j * LAYER) = {own()};
  own() = {};
  For k In {heel_curve(j) : heel_curve(j + 1) - 1}
    own() += heels(k);
  EndFor
  Physical Curve(StrCat("heel", suffix), HEEL + j * LAYER) = {own()};
  own() = {};
  For k In {toe_curve(j) : toe_curve(j + 1) - 1}
    own() += toes(k);
  EndFor
  Physical Curve(StrCat("toe", suffix), TOE + j * LAYER) = {own()};
EndFor
Physical Volume("foundation", FOUNDATION) = {foundation_volume()};
Physical Volume("lower dam", LOWER) = {lower_volume()};
Physical Surface("fixed", FIXED) = {left(), bottom(), right()};
Physical Surface("z faces", SIDES) = {back(), front()};
crest() = Point In BoundingBox {batter - eps, dam_height - eps, -eps,
                                batter + eps, dam_height + eps, eps};
Physical Point("crest", CREST) = {crest()};
For i In {0 : #seg_side() - 1}
  x0 = seg_x0(i);
  y0 = seg_y0(i);
  x1 = seg_x1(i);
  y1 = seg_y1(i);
  Call Around;
  around() -= joints();  // part of one, behind the drains, may lie in the box of a face
  name = StrCat(Str(side_names(seg_side(i))), Sprintf(" %g", i));
  Physical Surface(Str(name), SEGMENT + i) = {around()};
EndFor
For k In {0 : #mark_x() - 1}
  mark_curves() = Curve In BoundingBox {mark_x(k) - eps, mark_y(k) - eps, -eps,
                                mark_x(k) + eps, mark_y(k) + eps, thickness + eps};
  Physical Curve(mark_region(k)) = {mark_curves()};
EndFor
