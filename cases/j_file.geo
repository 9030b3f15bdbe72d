// Mesh of j_file.case.
Include "../pro/units.pro";
Include "j_file.case";
Include "c_file_regions.geo";
