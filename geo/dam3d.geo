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
  around() = Surface In BoundingBox {x_min - eps, y_min - eps, -eps,
                                     x0 + x1 - x_min + eps, y0 + y1 - y_min + eps, thickness + eps};
  flat() = Surface In BoundingBox {-far, -far, -eps, far, far, eps};
  around() -= flat();
  flat() = Surface In BoundingBox {-far, -far, thickness - eps, far, far, far};
  around() -= flat();
Return

x0 = heel_x;
y0 = heel_y;
x1 = toe_x;
y1 = toe_y;
Call Around;
joint() = {around()};
left() = Surface In BoundingBox {-far, -far, -far, -found_side + eps, far, far};
bottom() = Surface In BoundingBox {-far, -far, -far, far, -found_depth + eps, far};
right() = Surface In BoundingBox {end_x - eps, -far, -far, far, far, far};
back() = Surface In BoundingBox {-far, -far, -eps, far, far, eps};
front() = Surface In BoundingBox {-far, -far, thickness - eps, far, far, far};
heel() = Curve In BoundingBox {heel_x - eps, heel_y - eps, -eps,
                               heel_x + eps, heel_y + eps, thickness + eps};
toe() = Curve In BoundingBox {toe_x - eps, toe_y - eps, -eps,
                              toe_x + eps, toe_y + eps, thickness + eps};

If(!StrCmp(mesh_pattern, "free"))
  joint_skin() = Boundary { Surface{joint()}; };
  joint_skin() -= {heel(), toe()};
  If(drained)
    x0 = heel_x;
    y0 = heel_y;
    x1 = drain_line_x;
    y1 = drain_line_y;
    Call Around;
    drain_line() = Curve In BoundingBox {x1 - eps, y1 - eps, -eps, x1 + eps, y1 + eps,
                                         thickness + eps};
    first() = Boundary { Surface{around()}; };
    first() -= {heel(), drain_line()};
    joint_skin() -= {first(), drain_line()};
    Transfinite Curve {first()} = n_first + 1;
    Transfinite Curve {joint_skin()} = n_rest + 1;
    Transfinite Curve {drain_line()} = n_layers + 1;
  Else
    Transfinite Curve {joint_skin()} = n_joint + 1;
  EndIf
  Transfinite Curve {heel(), toe()} = n_layers + 1;
  Transfinite Surface {joint()};
EndIf

// Volumes, by the plane surface that each was extruded from
bodies() = Volume In BoundingBox {-far, -far, -far, far, far, far};
dam_volume() = {};
foundation_volume() = {};
lower_volume() = {};
For k In {0 : #bodies() - 1}
  skin() = Boundary { Volume{bodies(k)}; };
  kind = FOUNDATION;
  For j In {0 : #skin() - 1}
    kind = (Fabs(skin(j)) == dam(0)) ? DAM : kind;
    For n In {1 : #lower()}
      kind = (Fabs(skin(j)) == lower(n - 1)) ? LOWER : kind;
    EndFor
  EndFor
  If(kind == DAM)
    dam_volume() += bodies(k);
  ElseIf(kind == LOWER)
    lower_volume() += bodies(k);
  Else
    foundation_volume() += bodies(k);
  EndIf
EndFor

Physical Volume("dam", DAM) = {dam_volume()};
Physical Volume("foundation", FOUNDATION) = {foundation_volume()};
Physical Volume("lower dam", LOWER) = {lower_volume()};
Physical Surface("joint", JOINT) = {joint()};
Physical Surface("fixed", FIXED) = {left(), bottom(), right()};
Physical Surface("z faces", SIDES) = {back(), front()};
Physical Curve("heel", HEEL) = {heel()};
Physical Curve("toe", TOE) = {toe()};
crest() = Point In BoundingBox {batter - eps, dam_height - eps, -eps,
                                batter + eps, dam_height + eps, eps};
Physical Point("crest", CREST) = {crest()};
For i In {0 : #seg_side() - 1}
  x0 = seg_x0(i);
  y0 = seg_y0(i);
  x1 = seg_x1(i);
  y1 = seg_y1(i);
  Call Around;
  around() -= joint();  // part of it, behind the drains, may lie in the box of a face
  name = StrCat(Str(side_names(seg_side(i))), Sprintf(" %g", i));
  Physical Surface(Str(name), SEGMENT + i) = {around()};
EndFor
For k In {0 : #mark_x() - 1}
  mark_curves() = Curve In BoundingBox {mark_x(k) - eps, mark_y(k) - eps, -eps,
                                mark_x(k) + eps, mark_y(k) + eps, thickness + eps};
  Physical Curve(mark_region(k)) = {mark_curves()};
EndFor
