// The beam of in.cantilever_tets, 4 x 1 x 1.
// Another size of its tetrahedra: gmsh -3 -setnumber size 0.25 cantilever.geo -o finer.msh
DefineConstant[ size = 0.34 ];
SetFactory("Built-in");
Point(1) = {0, 0, 0, size};
Point(2) = {4, 0, 0, size};
Point(3) = {4, 1, 0, size};
Point(4) = {0, 1, 0, size};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
beam[] = Extrude {0, 0, 1} { Surface{1}; };
Physical Volume("beam") = {beam[1]};
