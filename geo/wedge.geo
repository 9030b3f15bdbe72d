// wedge.geo - half of a specimen split by wedges (WTNP128) [mm]: a block with a slot from above, a
// notch below it and the path of the crack, x = 0, by which the specimen is symmetric. A membrane
// at the bottom of the slot keeps the water in the notch. The wedge is a point force, whose
// displacement grows as the elements around it get smaller: of half the size, by 1 %.

DefineConstant[
  block = 300,         // width and height
  slot = 50,           // half of the slot's width
  notch = 50,          // height of the notch
  membrane = 1,        // height of the membrane above the notch
  wedge_at = 138,      // height at which the wedge presses on the slot's side
  size_path = 1,       // elements along the path
  size_far = 12.5      // elements far from it
];
half = block / 2;

Point(1) = {0, -half, 0, size_path};
Point(2) = {half, -half, 0, size_far};
Point(3) = {half, half, 0, size_far};
Point(4) = {slot, half, 0, size_far};
Point(5) = {slot, wedge_at, 0, size_far};
Point(6) = {slot, notch + membrane, 0, size_far};
Point(7) = {0, notch + membrane, 0, size_path};
Point(8) = {0, notch, 0, size_path};
Point(9) = {0, 0, 0, size_path};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 5};
Line(5) = {5, 6};
Line(6) = {6, 7};
Line(7) = {7, 8};
Line(8) = {8, 9};
Line(9) = {9, 1};
Transfinite Curve {7} = membrane / size_path + 1;
Transfinite Curve {8} = notch / size_path + 1;
Transfinite Curve {9} = half / size_path + 1;
Curve Loop(1) = {1 : 9};
Plane Surface(1) = {1};

Physical Surface("specimen") = {1};
Physical Curve("membrane") = {7};
Physical Curve("crack") = {8, 9};
Physical Point("mouth") = {8};
Physical Point("end") = {1};
Physical Point("wedge") = {5};
