// Mesh of j.case; the differences stand there.
Include "../pro/units.pro";
Include "j.case";
Include "../geo/window.geo";
