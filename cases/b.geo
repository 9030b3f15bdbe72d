// Mesh of b.case; the differences stand there.
Include "../pro/units.pro";
Include "b.case";
Include "../geo/window.geo";
