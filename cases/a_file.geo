// Mesh of a_file.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "a_file.case";
Include "../geo/window.geo";
