"""Words a drawing may contain: Gmsh's words for shapes, groups, numbers and pictures, which reach nothing else.

Each set is an allow-list; scan.py refuses any other word. Everything that runs programs, writes files or sends data is
left out on purpose, and also: ``Mesh`` as a command, views and plugins, which read and write files and are not needed
for a grid (skipped.py leaves out such statements); ``StringToName`` and ``NameToString``, which turn strings into words
and back; ``GetEnv``, ``FileExists``, ``ListFromFile``; ``GetValue``, which asks at the terminal; windows; the options
that name files and commands, start threads, or silence Gmsh's messages.
"""

from __future__ import annotations


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


# keywords of Gmsh's lexer with one harmless meaning each, wherever they stand
PLAIN = _words("""
    newp newl newc newll newcl news newsl newv newreg newf
    Abs Acos ArcCos ArcSin ArcTan ArcTan2 Asin Atan Atan2 Ceil Cos Cosh Exp Fabs Floor Fmod Hypot Log Log10 Max Min
    Modulo Pi Rand Round Sin Sinh Sqrt Step Tan Tanh Cpu Memory TotalMemory MPI_Rank MPI_Size TestLevel Today
    GMSH_MAJOR_VERSION GMSH_MINOR_VERSION GMSH_PATCH_VERSION CodeName OnelabAction
    Append Catenary DimNameSpace Exists Find GetForced GetForcedStr LinSpace List LogSpace
    Unique CurrentDir CurrentDirectory CurrentFileName DirName LowerCase LowerCaseIn Str StrCat StrChoice StrCmp
    StrFind StrLen StrPrefix StrRelative StrReplace StrSub UpperCase
    DefineConstant DefineNumber DefineString GetNumber GetString SetNumber SetString UndefineConstant
    BSpline Bezier Box Block CatmullRom Circle Cone Curve Cylinder Disk Ellipse Ellipsis Ellipsoid Knots Line Nurbs
    Order Plane Point PolarSphere Quadric Rectangle Ruled Sphere Spline Surface ThickSolid ThruSections Torus Volume
    Wedge Wire Coordinates Euclidian Euclidean Parametric GeoEntity
    BooleanCoherence BooleanCommon BooleanCut BooleanDifference BooleanFragments BooleanFuse BooleanIntersection
    BooleanSection BooleanUnion Chamfer Fillet
    Affine Dilate Extrude Intersect Rotate Split Symmetry Translate Closest
    Hole Layers QuadTriAddVerts QuadTriNoNewVerts RecombLaterals ScaleLastLayer
    BoundingBox CenterOfMass Curvature Mass MatrixOfInertia Normal Parent Physical
    Characteristic Compound Degenerated Elliptic Length MeshAlgorithm MeshSize MeshSizeFromBoundary Periodic Recombine
    ClassifySurfaces CreateGeometry CreateTopology NewModel Reverse ReverseMesh Smoother TransfQuadTri Transfinite
    Coherence Color Delete HealShapes Hide In Recursive SetMaxTag SetTag Show SyncModel Using
""")
CONTROL = _words("For EndFor If ElseIf Else EndIf Macro Function Return Call")

# words that mean something behind another one
BEHIND = {
    "Coherence": _words("Geometry Mesh"),
    "Delete": _words("Embedded Meshes Model Physicals Struct Variables"),
    "Using": _words("""Beta Beta_HWall Beta_Symmetrical Beta_Symmetrical_HWall Bump Bump_HWall Index Power Progression
        Progression_HWall Sewing"""),
}
# words that mean something before another token
BEFORE = {
    "Background": "Field",
    "Boundary": "{",
    "BoundaryLayer": "Field",
    "CombinedBoundary": "{",
    "Duplicata": "{",
    "OrientedBoundary": "{",
    "OrientedCombinedBoundary": "{",
    "PointsOf": "{",
    "Loop": "(",  # of curves or surfaces
}
ARRANGEMENTS = _words("Alternate AlternateLeft AlternateRight Left Right")  # of transfinite triangles
# names of what comes next, in the brackets of DefineConstant, DefineNumber and DefineString
ATTRIBUTES = _words("""
    AutoCheck ChangedValue Choices Closed Enum Graph Help Highlight Kind Label Loop Max Min Name NeverChanged Range
    ReadOnly ReadOnlyRange Step Units Visible
""")
COLORS = _words("""
    Aquamarine Beige Black Blue Brown Coral Cyan DarkBlue DarkGreen DarkOrange DarkRed DimGrey ForestGreen Gold Gray
    Green Grey Grey10 Grey20 Grey30 Grey40 Grey50 Grey60 Grey70 Grey80 Grey90 Indigo Ivory Khaki Lavender LightBlue
    LightGreen LightGrey LightYellow Magenta Maroon Navy NavyBlue Orange OrangeRed Orchid Pink Purple Red RoyalBlue
    Salmon SeaGreen Sienna SkyBlue SlateGrey Snow SteelBlue Thistle Tomato Turquoise Violet Wheat White Yellow
    YellowGreen
""")

# "Class.Name": what may be asked and set
OPTIONS = {
    "General": _words("""
        AlphaBlending Antialiasing ArrowHeadRadius ArrowStemLength ArrowStemRadius Axes AxesAutoPosition
        AxesLabelX AxesLabelY AxesLabelZ AxesMaxX AxesMaxY AxesMaxZ AxesMikado AxesMinX AxesMinY AxesMinZ AxesTicsX
        AxesTicsY AxesTicsZ BackgroundGradient BoundingBoxSize Clip0A Clip0B Clip0C Clip0D ClipFactor ColorScheme
        DrawBoundingBoxes ExpertMode FastRedraw FontSize GraphicsFontSize GraphicsHeight GraphicsWidth Light0 Light0X
        Light0Y Light0Z LineWidth MaxX MaxY MaxZ MenuHeight MenuWidth MessageFontSize MinX MinY MinZ MouseSelection
        Orthographic PointSize QuadricSubdivisions RotationCenterGravity RotationCenterX RotationCenterY
        RotationCenterZ RotationX RotationY RotationZ ScaleX ScaleY ScaleZ Shininess SmallAxes Terminal Tooltips
        Trackball TrackballQuaternion0 TrackballQuaternion1 TrackballQuaternion2 TrackballQuaternion3 TranslationX
        TranslationY TranslationZ Version ZoomFactor
    """),
    "Geometry": _words("""
        AutoCoherence CopyMeshingMethod CurveLabels CurveNumbers CurveType CurveWidth Curves ExactExtrusion
        ExtrudeReturnLateralEntities ExtrudeSplinePoints FirstEntityTag FirstPhysicalTag HideCompounds
        HighlightOrphans LabelType Light LightTwoSide LineNumbers LineWidth Lines Normals NumSubEdges OCCAutoEmbed
        OCCAutoFix OCCBooleanCheckInverted OCCBooleanGlue OCCBooleanNonDestructive OCCBooleanPreserveNumbering
        OCCBooleanSimplify OCCBoundsUseStl OCCFastUnbind OCCFixDegenerated OCCFixSmallEdges OCCFixSmallFaces
        OCCImportLabels OCCMakeSolids OCCScaling OCCSewFaces OCCTargetUnit OCCThruSectionsDegree OCCUnionUnify
        OffsetX OffsetY OffsetZ OldCircle OldNewReg OldRuledSurface OrientedPhysicals PointLabels PointNumbers
        PointSize PointType Points ScalingFactor SnapX SnapY SnapZ SurfaceLabels SurfaceNumbers SurfaceType Surfaces
        Tangents Tolerance ToleranceBoolean VolumeLabels VolumeNumbers VolumeType Volumes
    """),
    "Mesh": _words("""
        Algorithm Algorithm3D AlgorithmSwitchOnFailure AngleSmoothNormals AngleToleranceFacetOverlap AnisoMax Binary
        BoundaryLayerFanElements CharacteristicLengthExtendFromBoundary CharacteristicLengthFactor
        CharacteristicLengthFromCurvature CharacteristicLengthFromPoints CharacteristicLengthMax
        CharacteristicLengthMin ColorCarousel CompoundClassify CompoundMeshSizeFactor CpuTime Dual ElementOrder
        Explode FirstElementTag FirstNodeTag FlexibleTransfinite Format Hexahedra HighOrderNumLayers
        HighOrderOptimize HighOrderThresholdMax HighOrderThresholdMin LabelSampling LabelType LcIntegrationPrecision
        Light LightLines LightTwoSide LineNumbers LineWidth Lines MaxRetries MeshOnlyEmpty MeshOnlyVisible
        MeshSizeExtendFromBoundary MeshSizeFactor MeshSizeFromCurvature MeshSizeFromCurvatureIsotropic
        MeshSizeFromParametricPoints MeshSizeFromPoints MeshSizeMax MeshSizeMin MinimumCirclePoints
        MinimumCurvePoints MinimumElementsPerTwoPi MinCircleNodes MinCurveNodes MinLineNodes MshFileVersion NbNodes
        NbQuadrangles NbTetrahedra NbTriangles NodeLabels NodeSize NodeType Nodes Normals NumSubEdges Optimize
        OptimizeNetgen OptimizeThreshold PartitionCreateGhostCells PartitionCreatePhysicals PartitionCreateTopology
        PartitionOldStyleMsh2 PartitionSplitMeshFiles PointNumbers PointSize Points PreserveNumberingMsh2
        Quadrangles QualityInf
        QualitySup QualityType RandomFactor RandomFactor3D RandomSeed Recombine3DAll RecombineAll
        RecombineMinimumQuality RecombineNodeRepositioning RecombineOptimizeTopology RecombinationAlgorithm
        RefineSteps Renumber SaveAll SaveElementTagType SaveGroupsOfElements SaveGroupsOfNodes SaveParametric
        SaveTopology ScalingFactor SecondOrderIncomplete SecondOrderLinear Smoothing SmoothNormals SmoothRatio
        SubdivisionAlgorithm SurfaceEdges SurfaceFaces SurfaceLabels SurfaceNumbers Tangents Tetrahedra
        ToleranceEdgeLength ToleranceInitialDelaunay TransfiniteTri Triangles VolumeEdges VolumeFaces VolumeLabels
        Voronoi
    """),
    "PostProcessing": _words("NbViews"),
}
OPTION_COLORS = {
    "General": _words("AmbientLight Axes Background BackgroundGradient Foreground SmallAxes Text"),
    "Geometry": _words(
        "Curves HighlightOne HighlightTwo HighlightZero Lines Normals Points Selection Surfaces Volumes"
    ),
    "Mesh": _words("Hexahedra Lines Nodes Points Quadrangles Tetrahedra Triangles One Two Three Four Five"),
}
OPTION_SIZES = {  # of a mesh, which no grid has
    name for name in OPTIONS["Mesh"] if name.startswith(("MeshSize", "CharacteristicLength", "Minimum", "Min"))
}

FIELDS = _words("""
    Attractor AttractorAnisoCurve Ball BoundaryLayer Box Constant Curvature Cylinder Distance Extend Frustum Gradient
    IntersectAniso Laplacian LonLat MathEval MathEvalAniso Max MaxEigenHessian Mean Min MinAniso Octree Param Restrict
    Threshold
""")
FIELD_OPTIONS = _words("""
    AnisoMax Beta BetaLaw CurvesList Delta DistMax DistMin EdgesList ExcludedFacesList ExcludedSurfacesList F FX FY FZ
    FacesList FanNodesList FanPointsList FanPointsSizesList FieldX FieldY FieldZ FieldsList FromStereo IField InField
    IncludeBoundary InnerR1 InnerR2 InnerV1 InnerV2 IntersectMetrics Kind LcMax LcMin NNodesByEdge NbLayers NodesList
    NumPointsPerCurve OuterR1 OuterR2 OuterV1 OuterV2 PointsList Power Quads R1_inner R1_outer R2_inner R2_outer Radius
    RadiusStereo Ratio RegionsList Sampling Sigmoid Size SizeFar SizeMax SizeMaxNormal SizeMaxTangent SizeMin
    SizeMinNormal SizeMinTangent SizesList StopAtDistMax SurfacesList Thickness VIn VOut VerticesList VolumesList X1 X2
    XAxis XCenter XMax XMin Y1 Y2 YAxis YCenter YMax YMin Z1 Z2 ZAxis ZCenter ZMax ZMin dMax dMin hfar hwall_n
    hwall_n_nodes hwall_t lMaxNormal lMaxTangent lMinNormal lMinTangent m11 m12 m13 m22 m23 m33 ratio thickness
""")
# commands that say nothing of shapes, which are left out with all that follows up to a semicolon
SKIPPED = _words("""
    AdaptMesh Alias AliasWithOptions Betti Cohomology Combine CopyOptions Draw Homology OptimizeMesh PartitionMesh
    Plugin PostProcessing Print RecombineMesh RefineMesh RelocateMesh RenumberMeshElements RenumberMeshNodes Save
    SetOrder Sleep UnpartitionMesh View
""")
FACTORIES = _words("OpenCASCADE Built-in Gmsh")
