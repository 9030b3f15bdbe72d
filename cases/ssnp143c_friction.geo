// Mesh of ssnp143c_friction.case.
Include "../pro/units.pro";
Include "ssnp143c_friction.case";
Include "ssnp143c_regions.geo";
