// Mesh of ssnp143a.case.
Include "../pro/units.pro";
Include "ssnp143a.case";
Include "ssnp143a_regions.geo";
