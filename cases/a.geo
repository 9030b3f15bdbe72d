// Mesh of a.case; the differences stand there.
Include "../pro/units.pro";
Include "a.case";
Include "../geo/window.geo";
