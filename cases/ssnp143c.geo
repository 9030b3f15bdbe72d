// Mesh of ssnp143c.case.
Include "../pro/units.pro";
Include "ssnp143c.case";
Include "ssnp143c_regions.geo";
