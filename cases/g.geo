// Mesh of g.case; the differences stand there.
Include "g.case";
Include "../geo/window.geo";
