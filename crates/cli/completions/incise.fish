# Print an optspec for argparse to handle cmd's options that are independent of any subcommand.
function __fish_incise_global_optspecs
    string join \n h/help V/version
end

function __fish_incise_needs_command
    # Figure out if the current invocation already has a command.
    set -l cmd (commandline -opc)
    set -e cmd[1]
    argparse -s (__fish_incise_global_optspecs) -- $cmd 2>/dev/null
    or return
    if set -q argv[1]
        # Also print the command, so this can be used to figure out what it is.
        echo $argv[1]
        return 1
    end
    return 0
end

function __fish_incise_using_subcommand
    set -l cmd (__fish_incise_needs_command)
    test -z "$cmd"
    and return 1
    contains -- $cmd[1] $argv
end

complete -c incise -n "__fish_incise_needs_command" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c incise -n "__fish_incise_needs_command" -s V -l version -d 'Print version'
complete -c incise -n "__fish_incise_needs_command" -f -a "run" -d 'Simulate a scene and write reports, surfaces and images'
complete -c incise -n "__fish_incise_needs_command" -f -a "advise" -d 'Find the most accurate solver settings for a time budget on this machine'
complete -c incise -n "__fish_incise_needs_command" -f -a "color" -d 'Cluster and color the constraints of a mesh or the vertices of a graph'
complete -c incise -n "__fish_incise_needs_command" -f -a "scene" -d 'Print the keys of scene files, or validate a scene'
complete -c incise -n "__fish_incise_needs_command" -f -a "sweep" -d 'Run a scene for all combinations of values of its keys, and write one table'
complete -c incise -n "__fish_incise_needs_command" -f -a "mesh" -d 'Inspect, convert and generate meshes'
complete -c incise -n "__fish_incise_needs_command" -f -a "completions" -d 'Print completions for a shell'
complete -c incise -n "__fish_incise_needs_command" -f -a "man" -d 'Write manual pages, one for each command'
complete -c incise -n "__fish_incise_needs_command" -f -a "help" -d 'Print this message or the help of the given subcommand(s)'
complete -c incise -n "__fish_incise_using_subcommand run" -l mesh -d 'Use this mesh for the scene\'s first body' -r -F
complete -c incise -n "__fish_incise_using_subcommand run" -l frames -d 'Number of frames [default: 200, or more if a stroke ends later]' -r
complete -c incise -n "__fish_incise_using_subcommand run" -l backend -d 'Compute device; auto takes a hardware GPU if one supports the scene [default: that of the scene]' -r -f -a "cpu\t'The CPU'
gpu\t'A GPU; an error if there is none'
auto\t'A hardware GPU if one supports the scene, else the CPU'"
complete -c incise -n "__fish_incise_using_subcommand run" -l precision -d 'Floating-point precision [default: that of the scene]' -r -f -a "f32\t'Single: 32 bits'
f64\t'Double: 64 bits'"
complete -c incise -n "__fish_incise_using_subcommand run" -l threads -d 'Number of threads, at most 1024 [default: one for each core]. It does not change the result' -r
complete -c incise -n "__fish_incise_using_subcommand run" -l out -d 'Folder for the scene, frame reports, surfaces, images and the last mesh' -r -F
complete -c incise -n "__fish_incise_using_subcommand run" -l jsonl -d 'Also write one JSON object per frame to this file' -r -F
complete -c incise -n "__fish_incise_using_subcommand run" -l save-mesh -d 'Write the last rest mesh to this file; a .vtu file also has the deformed positions' -r -F
complete -c incise -n "__fish_incise_using_subcommand run" -l animation -d 'Write an animation: .gif, or .png for an animated PNG' -r -F
complete -c incise -n "__fish_incise_using_subcommand run" -l fps -d 'Images of the animation for each second, shown at this rate [default: about 25]' -r
complete -c incise -n "__fish_incise_using_subcommand run" -l size -d 'Width and height of images in pixels [default: 640x480]' -r
complete -c incise -n "__fish_incise_using_subcommand run" -l view -d 'Camera: azimuth and elevation in degrees, and zoom; at zoom 1 the bodies fit the image at the start [default: -60,22,1, and the camera steps back where bodies would leave the image]' -r
complete -c incise -n "__fish_incise_using_subcommand run" -l color-by -d 'Quantity that colors show in images: tissue, color, cluster, piece, stretch or residual. With residual every frame reports it' -r
complete -c incise -n "__fish_incise_using_subcommand run" -l no-pictures -d 'Write no images and no contact sheet'
complete -c incise -n "__fish_incise_using_subcommand run" -l wireframe -d 'Draw the edges of triangles'
complete -c incise -n "__fish_incise_using_subcommand run" -l check -d 'Validate all derived data after every cut (slow)'
complete -c incise -n "__fish_incise_using_subcommand run" -l keep-going -d 'Continue if the solution diverges; without this the run ends there with exit code 1'
complete -c incise -n "__fish_incise_using_subcommand run" -l quiet -d 'Print only errors; warnings are in frames.jsonl'
complete -c incise -n "__fish_incise_using_subcommand run" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c incise -n "__fish_incise_using_subcommand advise" -l budget-ms -d 'Largest computing time of a frame in ms' -r
complete -c incise -n "__fish_incise_using_subcommand advise" -l frames -d 'Number of frames that are measured, from the first on [default: half a second and all strokes and attachments, at most 100]' -r
complete -c incise -n "__fish_incise_using_subcommand advise" -l threads -d 'Number of threads, at most 1024 [default: one for each core]' -r
complete -c incise -n "__fish_incise_using_subcommand advise" -l json -d 'Print one JSON object instead of text'
complete -c incise -n "__fish_incise_using_subcommand advise" -s h -l help -d 'Print help'
complete -c incise -n "__fish_incise_using_subcommand color" -l algorithm -d 'The coloring: auto, scgc, jones-plassmann, ecl-gc, vivace, wlc, mcs, greedy, dsatur, iterated-greedy or tabu' -r
complete -c incise -n "__fish_incise_using_subcommand color" -l clustering -d 'The clustering: none, serial:K, serial-loose:K, greedy-k:K or pressure:K' -r
complete -c incise -n "__fish_incise_using_subcommand color" -l backend -d 'Compute device; gpu supports jones-plassmann, ecl-gc, scgc, vivace and wlc' -r -f -a "cpu\t'The CPU'
gpu\t'A GPU; an error if there is none'"
complete -c incise -n "__fish_incise_using_subcommand color" -l seed -d 'Seed of vivace, greedy:random, iterated-greedy and tabu; the others use none' -r
complete -c incise -n "__fish_incise_using_subcommand color" -l balance -d 'Balance the colors by clusters or by constraints without adding any' -r -f -a "clusters\t'Number of clusters: the parallelism of a color'
constraints\t'Number of constraints: the work of a color'"
complete -c incise -n "__fish_incise_using_subcommand color" -l csv -d 'Write the cluster and color of each constraint (of a graph: of each vertex) to this CSV file' -r -F
complete -c incise -n "__fish_incise_using_subcommand color" -l json -d 'Print one JSON object instead of a table'
complete -c incise -n "__fish_incise_using_subcommand color" -s h -l help -d 'Print help (see more with \'--help\')'
complete -c incise -n "__fish_incise_using_subcommand scene" -l check -d 'Validate a scene without running it' -r -F
complete -c incise -n "__fish_incise_using_subcommand scene" -l defaults -d 'Print a commented scene with every default'
complete -c incise -n "__fish_incise_using_subcommand scene" -l schema -d 'Print the JSON Schema of scene files'
complete -c incise -n "__fish_incise_using_subcommand scene" -l reference -d 'Print the reference of all keys in Markdown'
complete -c incise -n "__fish_incise_using_subcommand scene" -s h -l help -d 'Print help'
complete -c incise -n "__fish_incise_using_subcommand sweep" -l set -d 'A key of the scene and its values, separated by commas. Several keys give all combinations' -r
complete -c incise -n "__fish_incise_using_subcommand sweep" -l frames -d 'Number of frames of each run [default: 200, or more if a stroke ends later]' -r
complete -c incise -n "__fish_incise_using_subcommand sweep" -l out -d 'Folder of the results; a study continues from what it holds' -r -F
complete -c incise -n "__fish_incise_using_subcommand sweep" -l shard -d 'Run one share of the combinations, as 2/5 for the second of five, and write no table' -r
complete -c incise -n "__fish_incise_using_subcommand sweep" -l merge -d 'Run nothing: collect the shares in these folders, and write the table. A missing combination is an error' -r -F
complete -c incise -n "__fish_incise_using_subcommand sweep" -l threads -d 'Number of threads, at most 1024 [default: one for each core]' -r
complete -c incise -n "__fish_incise_using_subcommand sweep" -l partial -d 'Write the table without missing combinations'
complete -c incise -n "__fish_incise_using_subcommand sweep" -l quiet -d 'Print only errors'
complete -c incise -n "__fish_incise_using_subcommand sweep" -s h -l help -d 'Print help'
complete -c incise -n "__fish_incise_using_subcommand mesh; and not __fish_seen_subcommand_from info convert tetrahedralize generate help" -s h -l help -d 'Print help'
complete -c incise -n "__fish_incise_using_subcommand mesh; and not __fish_seen_subcommand_from info convert tetrahedralize generate help" -f -a "info" -d 'Check a mesh and print its statistics; of a surface, whether it can be filled'
complete -c incise -n "__fish_incise_using_subcommand mesh; and not __fish_seen_subcommand_from info convert tetrahedralize generate help" -f -a "convert" -d 'Convert a mesh or a surface between formats, which the file endings determine. Surface formats (.obj, .stl, .ply, .off, .glb, .gltf) get the boundary of a mesh'
complete -c incise -n "__fish_incise_using_subcommand mesh; and not __fish_seen_subcommand_from info convert tetrahedralize generate help" -f -a "tetrahedralize" -d 'Fill a closed triangle surface with tets'
complete -c incise -n "__fish_incise_using_subcommand mesh; and not __fish_seen_subcommand_from info convert tetrahedralize generate help" -f -a "generate" -d 'Generate a shape of longest side 1'
complete -c incise -n "__fish_incise_using_subcommand mesh; and not __fish_seen_subcommand_from info convert tetrahedralize generate help" -f -a "help" -d 'Print this message or the help of the given subcommand(s)'
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from info" -l young-modulus -d 'Young\'s modulus in Pa, for the number of substeps' -r
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from info" -l density -d 'Mass density in kg/m³, for the number of substeps' -r
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from info" -l time-step -d 'Time of a frame in s, for the number of substeps' -r
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from info" -l json -d 'Print one JSON object instead of tables'
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from info" -s h -l help -d 'Print help'
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from convert" -l repair -d 'Merge coincident particles, remove degenerate and duplicate tets, reorient inverted ones, keep the largest piece and its particles; prints the changes'
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from convert" -s h -l help -d 'Print help'
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from tetrahedralize" -l tets -d 'Wanted number of tets; the result is within 2%' -r
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from tetrahedralize" -l levels -d 'Number of times that tets deep inside may be doubled in size, which leaves more for the surface' -r
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from tetrahedralize" -s h -l help -d 'Print help'
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from generate" -l tets -d 'Wanted number of tets; the result is within 2%' -r
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from generate" -s h -l help -d 'Print help'
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from help" -f -a "info" -d 'Check a mesh and print its statistics; of a surface, whether it can be filled'
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from help" -f -a "convert" -d 'Convert a mesh or a surface between formats, which the file endings determine. Surface formats (.obj, .stl, .ply, .off, .glb, .gltf) get the boundary of a mesh'
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from help" -f -a "tetrahedralize" -d 'Fill a closed triangle surface with tets'
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from help" -f -a "generate" -d 'Generate a shape of longest side 1'
complete -c incise -n "__fish_incise_using_subcommand mesh; and __fish_seen_subcommand_from help" -f -a "help" -d 'Print this message or the help of the given subcommand(s)'
complete -c incise -n "__fish_incise_using_subcommand completions" -s h -l help -d 'Print help'
complete -c incise -n "__fish_incise_using_subcommand man" -s h -l help -d 'Print help'
complete -c incise -n "__fish_incise_using_subcommand help; and not __fish_seen_subcommand_from run advise color scene sweep mesh completions man help" -f -a "run" -d 'Simulate a scene and write reports, surfaces and images'
complete -c incise -n "__fish_incise_using_subcommand help; and not __fish_seen_subcommand_from run advise color scene sweep mesh completions man help" -f -a "advise" -d 'Find the most accurate solver settings for a time budget on this machine'
complete -c incise -n "__fish_incise_using_subcommand help; and not __fish_seen_subcommand_from run advise color scene sweep mesh completions man help" -f -a "color" -d 'Cluster and color the constraints of a mesh or the vertices of a graph'
complete -c incise -n "__fish_incise_using_subcommand help; and not __fish_seen_subcommand_from run advise color scene sweep mesh completions man help" -f -a "scene" -d 'Print the keys of scene files, or validate a scene'
complete -c incise -n "__fish_incise_using_subcommand help; and not __fish_seen_subcommand_from run advise color scene sweep mesh completions man help" -f -a "sweep" -d 'Run a scene for all combinations of values of its keys, and write one table'
complete -c incise -n "__fish_incise_using_subcommand help; and not __fish_seen_subcommand_from run advise color scene sweep mesh completions man help" -f -a "mesh" -d 'Inspect, convert and generate meshes'
complete -c incise -n "__fish_incise_using_subcommand help; and not __fish_seen_subcommand_from run advise color scene sweep mesh completions man help" -f -a "completions" -d 'Print completions for a shell'
complete -c incise -n "__fish_incise_using_subcommand help; and not __fish_seen_subcommand_from run advise color scene sweep mesh completions man help" -f -a "man" -d 'Write manual pages, one for each command'
complete -c incise -n "__fish_incise_using_subcommand help; and not __fish_seen_subcommand_from run advise color scene sweep mesh completions man help" -f -a "help" -d 'Print this message or the help of the given subcommand(s)'
complete -c incise -n "__fish_incise_using_subcommand help; and __fish_seen_subcommand_from mesh" -f -a "info" -d 'Check a mesh and print its statistics; of a surface, whether it can be filled'
complete -c incise -n "__fish_incise_using_subcommand help; and __fish_seen_subcommand_from mesh" -f -a "convert" -d 'Convert a mesh or a surface between formats, which the file endings determine. Surface formats (.obj, .stl, .ply, .off, .glb, .gltf) get the boundary of a mesh'
complete -c incise -n "__fish_incise_using_subcommand help; and __fish_seen_subcommand_from mesh" -f -a "tetrahedralize" -d 'Fill a closed triangle surface with tets'
complete -c incise -n "__fish_incise_using_subcommand help; and __fish_seen_subcommand_from mesh" -f -a "generate" -d 'Generate a shape of longest side 1'
