// Mesh of d.case; the differences stand there.
Include "../pro/units.pro";
Include "d.case";
Include "../geo/window.geo";
