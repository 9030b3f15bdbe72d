// Mesh of ssnp143d.case.
Include "../pro/units.pro";
Include "ssnp143d.case";
Include "ssnp143d_regions.geo";
