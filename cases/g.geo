// Mesh of g.case; the differences stand there.
Include "../pro/units.pro";
Include "g.case";
Include "../geo/window.geo";
