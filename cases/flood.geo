// Mesh of flood.case.
Include "../pro/units.pro";
Include "flood.case";
// Made by python -m damjoint_tools.gmsh_files from the hydrograph.
levels() = {40, 40.3, 41, 42, 43, 43.7, 44, 43.9,
43.5, 43, 42.4, 41.8, 41.2, 40.8, 40.4, 40.2,
40.1};
tail_levels() = {0, 0, 0, 0, 0, 0, 0, 0,
0, 0, 0, 0, 0, 0, 0, 0,
0};
default_time_unit = 3600;
default_time_start = 1;
Include "../geo/window.geo";
