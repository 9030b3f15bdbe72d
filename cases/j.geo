// Mesh of j.case; the differences stand there.
Include "j.case";
Include "../geo/window.geo";
