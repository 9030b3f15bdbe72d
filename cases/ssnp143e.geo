// Mesh of ssnp143e.case.
Include "../pro/units.pro";
Include "ssnp143e.case";
Include "ssnp143a_regions.geo";
