// window.geo - the mesh of a case in the window of Gmsh: dam.geo, unless the case has a geometry of
// its own, and what the window shows of it.
//
// Read at the start and after each change of a parameter. The results are then those of other
// parameters, and the status in the tree says so until a run replaces it (pro/views.pro): also if a
// click on Run is lost while Gmsh checks the change, or the new value is refused.

// A window of Gmsh's default size is enlarged, to fit a screen of 1280 x 720.
If(General.GraphicsWidth == 800 && General.MenuWidth == 200)
  General.GraphicsWidth = 1180;  // with the tree
  General.GraphicsHeight = 600;
  General.MenuWidth = 420;
EndIf
General.GraphicsFontEngine = "StringTexture";  // the default one leaves out blanks
General.GraphicsFontSize = 12;
General.GraphicsFontSizeTitle = 14;

status_now = "not run yet";
If(GetNumber("0Results/1Water level [m]", -1) >= 0)
  status_now = "changed: press Run";
EndIf
// Gmsh defines a constant only once: each time a new one.
If(!Exists(status_number))
  status_number = 0;
EndIf
status_number += 1;
SetString("0Results/0Status", Str(status_now));
DefineConstant[
  status~{status_number} = {Str(status_now), Name "0Results/0Status", ReadOnly 1,
    Highlight "LightGrey"}
];

node_points = 1;
If(!Exists(geometry))
  Include "dam.geo";
EndIf
