// Mesh of e.case; the differences stand there.
Include "e.case";
Include "../geo/window.geo";
