// dam3d.geo - the plane scene of dam2d.geo extruded along z over the thickness.
// mesh_pattern free: tetrahedra; layers: prisms; split: layers cut into tetrahedra; regular:
// hexahedra (and a few prisms). The joint itself is always a grid of n_joint x n_layers rectangles,
// halved under tetrahedra.

Include "dam2d.geo";

If(!StrCmp(mesh_pattern, "free"))
  Extrude {0, 0, thickness} { Surface{dam(), foundation()}; }
ElseIf(!StrCmp(mesh_pattern, "split"))
  Extrude {0, 0, thickness} { Surface{dam(), foundation()}; Layers{n_layers}; }
Else
  Extrude {0, 0, thickness} { Surface{dam(), foundation()}; Layers{n_layers}; Recombine; }
EndIf

// The regions are found again by their place: eps around it, far beyond everything.
far = 2 * (dam_base + dam_crest + 2 * found_side + found_depth + dam_height + thickness);
eps = 1e-7 * far;
toe_x = dam_base;
end_x = dam_base + found_side;

joint() = Surface In BoundingBox {-eps, -eps, -far, toe_x + eps, eps, far};
upstream() = Surface In BoundingBox {-eps, -eps, -far, eps, far, far};
left() = Surface In BoundingBox {-far, -far, -far, -found_side + eps, far, far};
bottom() = Surface In BoundingBox {-far, -far, -far, far, -found_depth + eps, far};
right() = Surface In BoundingBox {end_x - eps, -far, -far, far, far, far};
back() = Surface In BoundingBox {-far, -far, -eps, far, far, eps};
front() = Surface In BoundingBox {-far, -far, thickness - eps, far, far, far};
dam_volume() = Volume In BoundingBox {-far, -eps, -far, far, far, far};
foundation_volume() = Volume In BoundingBox {-far, -far, -far, far, eps, far};
dam_skin() = Boundary { Volume{dam_volume()}; };
top() = Surface In BoundingBox {-far, dam_height - eps, -far, far, far, far};
downstream() = dam_skin();
downstream() -= {joint(), upstream(), back(), front(), top()};
heel() = Curve In BoundingBox {-eps, -eps, -far, eps, eps, far};
toe() = Curve In BoundingBox {toe_x - eps, -eps, -far, toe_x + eps, eps, far};

If(!StrCmp(mesh_pattern, "free"))
  joint_skin() = Boundary { Surface{joint()}; };
  joint_skin() -= {heel(), toe()};
  Transfinite Curve {joint_skin()} = n_joint + 1;
  Transfinite Curve {heel(), toe()} = n_layers + 1;
  Transfinite Surface {joint()};
EndIf

Physical Volume("dam", DAM) = dam_volume();
Physical Volume("foundation", FOUNDATION) = foundation_volume();
Physical Surface("joint", JOINT) = joint();
Physical Surface("upstream face", UPSTREAM) = upstream();
Physical Surface("downstream face", DOWNSTREAM) = downstream();
Physical Surface("fixed", FIXED) = {left(), bottom(), right()};
Physical Surface("z faces", SIDES) = {back(), front()};
Physical Curve("heel", HEEL) = heel();
Physical Curve("toe", TOE) = toe();
Physical Point("crest", CREST) = {4};
