// Mesh of icold1999.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "icold1999.case";
Include "../geo/window.geo";
