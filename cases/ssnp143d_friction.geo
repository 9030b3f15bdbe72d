// Mesh of ssnp143d_friction.case.
Include "../pro/units.pro";
Include "ssnp143d_friction.case";
Include "ssnp143d_regions.geo";
