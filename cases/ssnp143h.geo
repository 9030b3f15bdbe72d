// Mesh of ssnp143h.case.
Include "../pro/units.pro";
Include "ssnp143h.case";
Include "ssnp143b_regions.geo";
