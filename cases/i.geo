// Mesh of i.case; the differences stand there.
Include "i.case";
Include "../geo/window.geo";
