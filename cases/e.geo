// Mesh of e.case; the differences stand there.
Include "../pro/units.pro";
Include "e.case";
Include "../geo/window.geo";
