// ssnp142_file.geo - dam and rock as the test files of SSNP142 C, D and J mesh them.
//
// The joint is drawn 0.1 m thick there: the dam is 9.9 m high. Quadrangles, 50 at the joint and 16
// at the crest, both graded towards the joint by a factor of 20 between ten elements; triangles in
// the dam's lowest row. In 3D (dim = 3) 2 m thick, in ten layers.

Include "../pro/parameters.pro";

n_rows = 10;
n_base = 50;
n_top = 16;
growth = 20 ^ (1 / (n_rows - 1));
base = 5;
crest = 1.5;
height = 9.9;
side = 5;
row = height * (growth - 1) / (growth ^ n_rows - 1);  // height of the lowest row of the dam
row_top = base - (base - crest) * row / height;  // and its width at the top

// Dam: the nodes of its base and of the top of its lowest row
For k In {0 : n_base}
  Point(100 + k) = {base * k / n_base, 0, 0};
EndFor
For i In {0 : n_top}
  Point(200 + i) = {row_top * i / n_top, row, 0};
EndFor
Point(301) = {0, height, 0};
Point(302) = {crest, height, 0};
For k In {0 : n_base - 1}
  Line(100 + k) = {100 + k, 101 + k};
EndFor
For i In {0 : n_top - 1}
  Line(200 + i) = {200 + i, 201 + i};
EndFor
// each node of the base is joined with the nearest one above: a triangle or quadrangle per element
above() = {};
For k In {0 : n_base}
  nearest = Round(base * k / n_base * n_top / row_top);
  above() += (nearest < n_top) ? nearest : n_top;
  Line(400 + k) = {100 + k, 200 + above(k)};
EndFor
dam() = {};
For k In {0 : n_base - 1}
  around() = {100 + k, 401 + k};
  If(above(k + 1) > above(k))
    around() += -(200 + above(k));
  EndIf
  Curve Loop(100 + k) = {around(), -(400 + k)};
  Plane Surface(100 + k) = {100 + k};
  dam() += 100 + k;
EndFor
Transfinite Curve {100 : 99 + n_base, 200 : 199 + n_top, 400 : 400 + n_base} = 2;
Line(301) = {200, 301};
Line(302) = {200 + n_top, 302};
Line(303) = {301, 302};
Transfinite Curve {301, 302} = n_rows Using Progression growth;
Transfinite Curve {303} = n_top + 1;
Curve Loop(200) = {200 : 199 + n_top, 302, -303, -301};
Plane Surface(200) = {200};
Transfinite Surface {200} = {200, 200 + n_top, 302, 301};
dam() += 200;

// Rock: below the dam and beside it
Point(401) = {-side, 0, 0};
Point(402) = {-side, -side, 0};
Point(403) = {0, -side, 0};
Point(404) = {base, -side, 0};
Point(405) = {base + side, -side, 0};
Point(406) = {base + side, 0, 0};
Line(501) = {100, 401};
Line(502) = {401, 402};
Line(503) = {403, 402};
Line(504) = {403, 404};
Line(505) = {404, 405};
Line(506) = {406, 405};
Line(507) = {100 + n_base, 406};
Line(508) = {100, 403};
Line(509) = {100 + n_base, 404};
Transfinite Curve {501, 502, 503, 505, 506, 507, 508, 509} = n_rows + 1 Using Progression growth;
Transfinite Curve {504} = n_base + 1;
Curve Loop(501) = {501, 502, -503, -508};
Curve Loop(502) = {508, 504, -509, -(99 + n_base) : -100};
Curve Loop(503) = {509, 505, -506, -507};
For i In {501 : 503}
  Plane Surface(i) = {i};
EndFor
Transfinite Surface {501, 503};
Transfinite Surface {502} = {100, 403, 404, 100 + n_base};
Recombine Surface {dam(), 501 : 503};

If(dim == 2)
  Physical Surface("dam") = {dam()};
  Physical Surface("foundation") = {501 : 503};
  Physical Curve("joint") = {100 : 99 + n_base};
  Physical Curve("upstream") = {400, 301};
  Physical Curve("downstream") = {400 + n_base, 302};
  Physical Curve("fixed") = {502, 503, 504, 505, 506};
  Physical Point("heel") = {100};
  Physical Point("toe") = {100 + n_base};
Else
  thick = 2;
  eps = 1e-6;
  Extrude {0, 0, thick} { Surface{dam(), 501 : 503}; Layers{10}; Recombine; }
  Physical Volume("dam") = Volume In BoundingBox {-eps, -eps, -eps, base + eps, height + eps, 3};
  Physical Volume("foundation") = Volume In BoundingBox {-6, -6, -eps, 11, eps, 3};
  joint() = Surface In BoundingBox {-eps, -eps, -eps, base + eps, eps, 3};
  Physical Surface("joint") = {joint()};
  upstream() = Surface In BoundingBox {-eps, -eps, -eps, eps, height + eps, 3};
  Physical Surface("upstream") = {upstream()};
  fixed() = Surface In BoundingBox {-side - eps, -side - eps, -eps, -side + eps, eps, 3};
  fixed() += Surface In BoundingBox {-6, -side - eps, -eps, 11, -side + eps, 3};
  fixed() += Surface In BoundingBox {base + side - eps, -6, -eps, base + side + eps, eps, 3};
  Physical Surface("fixed") = {fixed()};
  heel() = Curve In BoundingBox {-eps, -eps, -eps, eps, eps, 3};
  toe() = Curve In BoundingBox {base - eps, -eps, -eps, base + eps, eps, 3};
  Physical Curve("heel") = {heel()};
  Physical Curve("toe") = {toe()};
EndIf
Physical Point("crest") = {301};
