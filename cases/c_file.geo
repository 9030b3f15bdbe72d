// Mesh of c_file.case.
Include "../pro/units.pro";
Include "c_file.case";
Include "c_file_regions.geo";
