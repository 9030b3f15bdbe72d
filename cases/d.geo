// Mesh of d.case; the differences stand there.
Include "d.case";
Include "../geo/window.geo";
