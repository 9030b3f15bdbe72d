// Mesh of c.case; the differences stand there.
Include "../pro/units.pro";
Include "c.case";
Include "../geo/window.geo";
