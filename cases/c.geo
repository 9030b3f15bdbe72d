// Mesh of c.case; the differences stand there.
Include "c.case";
Include "../geo/window.geo";
