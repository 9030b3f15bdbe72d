// Mesh of ssnp143b.case.
Include "../pro/units.pro";
Include "ssnp143b.case";
Include "ssnp143b_regions.geo";
