// Mesh of k.case; the differences stand there.
Include "k.case";
Include "../geo/window.geo";
