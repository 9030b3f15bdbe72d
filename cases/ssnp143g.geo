// Mesh of ssnp143g.case.
Include "../pro/units.pro";
Include "ssnp143g.case";
Include "ssnp143a_regions.geo";
