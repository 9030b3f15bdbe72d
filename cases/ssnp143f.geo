// Mesh of ssnp143f.case.
Include "../pro/units.pro";
Include "ssnp143f.case";
Include "ssnp143b_regions.geo";
