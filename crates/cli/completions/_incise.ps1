
using namespace System.Management.Automation
using namespace System.Management.Automation.Language

Register-ArgumentCompleter -Native -CommandName 'incise' -ScriptBlock {
    param($wordToComplete, $commandAst, $cursorPosition)

    $commandElements = $commandAst.CommandElements
    $command = @(
        'incise'
        for ($i = 1; $i -lt $commandElements.Count; $i++) {
            $element = $commandElements[$i]
            if ($element -isnot [StringConstantExpressionAst] -or
                $element.StringConstantType -ne [StringConstantType]::BareWord -or
                $element.Value.StartsWith('-') -or
                $element.Value -eq $wordToComplete) {
                break
        }
        $element.Value
    }) -join ';'

    $completions = @(switch ($command) {
        'incise' {
            [CompletionResult]::new('-h', '-h', [CompletionResultType]::ParameterName, 'Print help (see more with ''--help'')')
            [CompletionResult]::new('--help', '--help', [CompletionResultType]::ParameterName, 'Print help (see more with ''--help'')')
            [CompletionResult]::new('-V', '-V ', [CompletionResultType]::ParameterName, 'Print version')
            [CompletionResult]::new('--version', '--version', [CompletionResultType]::ParameterName, 'Print version')
            [CompletionResult]::new('run', 'run', [CompletionResultType]::ParameterValue, 'Simulate a scene and write reports, surfaces and images')
            [CompletionResult]::new('advise', 'advise', [CompletionResultType]::ParameterValue, 'Find the most accurate solver settings for a time budget on this machine')
            [CompletionResult]::new('color', 'color', [CompletionResultType]::ParameterValue, 'Cluster and color the constraints of a mesh or the vertices of a graph')
            [CompletionResult]::new('scene', 'scene', [CompletionResultType]::ParameterValue, 'Print the keys of scene files, or validate a scene')
            [CompletionResult]::new('sweep', 'sweep', [CompletionResultType]::ParameterValue, 'Run a scene for all combinations of values of its keys, and write one table')
            [CompletionResult]::new('mesh', 'mesh', [CompletionResultType]::ParameterValue, 'Inspect, convert and generate meshes')
            [CompletionResult]::new('completions', 'completions', [CompletionResultType]::ParameterValue, 'Print completions for a shell')
            [CompletionResult]::new('man', 'man', [CompletionResultType]::ParameterValue, 'Write manual pages, one for each command')
            [CompletionResult]::new('help', 'help', [CompletionResultType]::ParameterValue, 'Print this message or the help of the given subcommand(s)')
            break
        }
        'incise;run' {
            [CompletionResult]::new('--mesh', '--mesh', [CompletionResultType]::ParameterName, 'Use this mesh for the scene''s first body')
            [CompletionResult]::new('--frames', '--frames', [CompletionResultType]::ParameterName, 'Number of frames [default: 200, or more if a stroke ends later]')
            [CompletionResult]::new('--backend', '--backend', [CompletionResultType]::ParameterName, 'Compute device; auto takes a hardware GPU if one supports the scene [default: that of the scene]')
            [CompletionResult]::new('--precision', '--precision', [CompletionResultType]::ParameterName, 'Floating-point precision [default: that of the scene]')
            [CompletionResult]::new('--threads', '--threads', [CompletionResultType]::ParameterName, 'Number of threads, at most 1024 [default: one for each core]. It does not change the result')
            [CompletionResult]::new('--out', '--out', [CompletionResultType]::ParameterName, 'Folder for the scene, frame reports, surfaces, images and the last mesh')
            [CompletionResult]::new('--jsonl', '--jsonl', [CompletionResultType]::ParameterName, 'Also write one JSON object per frame to this file')
            [CompletionResult]::new('--save-mesh', '--save-mesh', [CompletionResultType]::ParameterName, 'Write the last rest mesh to this file; a .vtu file also has the deformed positions')
            [CompletionResult]::new('--animation', '--animation', [CompletionResultType]::ParameterName, 'Write an animation: .gif, or .png for an animated PNG')
            [CompletionResult]::new('--fps', '--fps', [CompletionResultType]::ParameterName, 'Images of the animation for each second, shown at this rate [default: about 25]')
            [CompletionResult]::new('--size', '--size', [CompletionResultType]::ParameterName, 'Width and height of images in pixels [default: 640x480]')
            [CompletionResult]::new('--view', '--view', [CompletionResultType]::ParameterName, 'Camera: azimuth and elevation in degrees, and zoom; at zoom 1 the bodies fit the image at the start [default: -60,22,1, and the camera steps back where bodies would leave the image]')
            [CompletionResult]::new('--color-by', '--color-by', [CompletionResultType]::ParameterName, 'Quantity that colors show in images: tissue, color, cluster, piece, stretch or residual. With residual every frame reports it')
            [CompletionResult]::new('--no-pictures', '--no-pictures', [CompletionResultType]::ParameterName, 'Write no images and no contact sheet')
            [CompletionResult]::new('--wireframe', '--wireframe', [CompletionResultType]::ParameterName, 'Draw the edges of triangles')
            [CompletionResult]::new('--check', '--check', [CompletionResultType]::ParameterName, 'Validate all derived data after every cut (slow)')
            [CompletionResult]::new('--keep-going', '--keep-going', [CompletionResultType]::ParameterName, 'Continue if the solution diverges; without this the run ends there with exit code 1')
            [CompletionResult]::new('--quiet', '--quiet', [CompletionResultType]::ParameterName, 'Print only errors; warnings are in frames.jsonl')
            [CompletionResult]::new('-h', '-h', [CompletionResultType]::ParameterName, 'Print help (see more with ''--help'')')
            [CompletionResult]::new('--help', '--help', [CompletionResultType]::ParameterName, 'Print help (see more with ''--help'')')
            break
        }
        'incise;advise' {
            [CompletionResult]::new('--budget-ms', '--budget-ms', [CompletionResultType]::ParameterName, 'Largest computing time of a frame in ms')
            [CompletionResult]::new('--frames', '--frames', [CompletionResultType]::ParameterName, 'Number of frames that are measured, from the first on [default: half a second and all strokes and attachments, at most 100]')
            [CompletionResult]::new('--threads', '--threads', [CompletionResultType]::ParameterName, 'Number of threads, at most 1024 [default: one for each core]')
            [CompletionResult]::new('--json', '--json', [CompletionResultType]::ParameterName, 'Print one JSON object instead of text')
            [CompletionResult]::new('-h', '-h', [CompletionResultType]::ParameterName, 'Print help')
            [CompletionResult]::new('--help', '--help', [CompletionResultType]::ParameterName, 'Print help')
            break
        }
        'incise;color' {
            [CompletionResult]::new('--algorithm', '--algorithm', [CompletionResultType]::ParameterName, 'The coloring: auto, scgc, jones-plassmann, ecl-gc, vivace, wlc, mcs, greedy, dsatur, iterated-greedy or tabu')
            [CompletionResult]::new('--clustering', '--clustering', [CompletionResultType]::ParameterName, 'The clustering: none, serial:K, serial-loose:K, greedy-k:K or pressure:K')
            [CompletionResult]::new('--backend', '--backend', [CompletionResultType]::ParameterName, 'Compute device; gpu supports jones-plassmann, ecl-gc, scgc, vivace and wlc')
            [CompletionResult]::new('--seed', '--seed', [CompletionResultType]::ParameterName, 'Seed of vivace, greedy:random, iterated-greedy and tabu; the others use none')
            [CompletionResult]::new('--balance', '--balance', [CompletionResultType]::ParameterName, 'Balance the colors by clusters or by constraints without adding any')
            [CompletionResult]::new('--csv', '--csv', [CompletionResultType]::ParameterName, 'Write the cluster and color of each constraint (of a graph: of each vertex) to this CSV file')
            [CompletionResult]::new('--json', '--json', [CompletionResultType]::ParameterName, 'Print one JSON object instead of a table')
            [CompletionResult]::new('-h', '-h', [CompletionResultType]::ParameterName, 'Print help (see more with ''--help'')')
            [CompletionResult]::new('--help', '--help', [CompletionResultType]::ParameterName, 'Print help (see more with ''--help'')')
            break
        }
        'incise;scene' {
            [CompletionResult]::new('--check', '--check', [CompletionResultType]::ParameterName, 'Validate a scene without running it')
            [CompletionResult]::new('--defaults', '--defaults', [CompletionResultType]::ParameterName, 'Print a commented scene with every default')
            [CompletionResult]::new('--schema', '--schema', [CompletionResultType]::ParameterName, 'Print the JSON Schema of scene files')
            [CompletionResult]::new('--reference', '--reference', [CompletionResultType]::ParameterName, 'Print the reference of all keys in Markdown')
            [CompletionResult]::new('-h', '-h', [CompletionResultType]::ParameterName, 'Print help')
            [CompletionResult]::new('--help', '--help', [CompletionResultType]::ParameterName, 'Print help')
            break
        }
        'incise;sweep' {
            [CompletionResult]::new('--set', '--set', [CompletionResultType]::ParameterName, 'A key of the scene and its values, separated by commas. Several keys give all combinations')
            [CompletionResult]::new('--frames', '--frames', [CompletionResultType]::ParameterName, 'Number of frames of each run [default: 200, or more if a stroke ends later]')
            [CompletionResult]::new('--out', '--out', [CompletionResultType]::ParameterName, 'Folder of the results; a study continues from what it holds')
            [CompletionResult]::new('--shard', '--shard', [CompletionResultType]::ParameterName, 'Run one share of the combinations, as 2/5 for the second of five, and write no table')
            [CompletionResult]::new('--merge', '--merge', [CompletionResultType]::ParameterName, 'Run nothing: collect the shares in these folders, and write the table. A missing combination is an error')
            [CompletionResult]::new('--threads', '--threads', [CompletionResultType]::ParameterName, 'Number of threads, at most 1024 [default: one for each core]')
            [CompletionResult]::new('--partial', '--partial', [CompletionResultType]::ParameterName, 'Write the table without missing combinations')
            [CompletionResult]::new('--quiet', '--quiet', [CompletionResultType]::ParameterName, 'Print only errors')
            [CompletionResult]::new('-h', '-h', [CompletionResultType]::ParameterName, 'Print help')
            [CompletionResult]::new('--help', '--help', [CompletionResultType]::ParameterName, 'Print help')
            break
        }
        'incise;mesh' {
            [CompletionResult]::new('-h', '-h', [CompletionResultType]::ParameterName, 'Print help')
            [CompletionResult]::new('--help', '--help', [CompletionResultType]::ParameterName, 'Print help')
            [CompletionResult]::new('info', 'info', [CompletionResultType]::ParameterValue, 'Check a mesh and print its statistics; of a surface, whether it can be filled')
            [CompletionResult]::new('convert', 'convert', [CompletionResultType]::ParameterValue, 'Convert a mesh or a surface between formats, which the file endings determine. Surface formats (.obj, .stl, .ply, .off, .glb, .gltf) get the boundary of a mesh')
            [CompletionResult]::new('tetrahedralize', 'tetrahedralize', [CompletionResultType]::ParameterValue, 'Fill a closed triangle surface with tets')
            [CompletionResult]::new('generate', 'generate', [CompletionResultType]::ParameterValue, 'Generate a shape of longest side 1')
            [CompletionResult]::new('help', 'help', [CompletionResultType]::ParameterValue, 'Print this message or the help of the given subcommand(s)')
            break
        }
        'incise;mesh;info' {
            [CompletionResult]::new('--young-modulus', '--young-modulus', [CompletionResultType]::ParameterName, 'Young''s modulus in Pa, for the number of substeps')
            [CompletionResult]::new('--density', '--density', [CompletionResultType]::ParameterName, 'Mass density in kg/m³, for the number of substeps')
            [CompletionResult]::new('--time-step', '--time-step', [CompletionResultType]::ParameterName, 'Time of a frame in s, for the number of substeps')
            [CompletionResult]::new('--json', '--json', [CompletionResultType]::ParameterName, 'Print one JSON object instead of tables')
            [CompletionResult]::new('-h', '-h', [CompletionResultType]::ParameterName, 'Print help')
            [CompletionResult]::new('--help', '--help', [CompletionResultType]::ParameterName, 'Print help')
            break
        }
        'incise;mesh;convert' {
            [CompletionResult]::new('--repair', '--repair', [CompletionResultType]::ParameterName, 'Merge coincident particles, remove degenerate and duplicate tets, reorient inverted ones, keep the largest piece and its particles; prints the changes')
            [CompletionResult]::new('-h', '-h', [CompletionResultType]::ParameterName, 'Print help')
            [CompletionResult]::new('--help', '--help', [CompletionResultType]::ParameterName, 'Print help')
            break
        }
        'incise;mesh;tetrahedralize' {
            [CompletionResult]::new('--tets', '--tets', [CompletionResultType]::ParameterName, 'Wanted number of tets; the result is within 2%')
            [CompletionResult]::new('--levels', '--levels', [CompletionResultType]::ParameterName, 'Number of times that tets deep inside may be doubled in size, which leaves more for the surface')
            [CompletionResult]::new('-h', '-h', [CompletionResultType]::ParameterName, 'Print help')
            [CompletionResult]::new('--help', '--help', [CompletionResultType]::ParameterName, 'Print help')
            break
        }
        'incise;mesh;generate' {
            [CompletionResult]::new('--tets', '--tets', [CompletionResultType]::ParameterName, 'Wanted number of tets; the result is within 2%')
            [CompletionResult]::new('-h', '-h', [CompletionResultType]::ParameterName, 'Print help')
            [CompletionResult]::new('--help', '--help', [CompletionResultType]::ParameterName, 'Print help')
            break
        }
        'incise;mesh;help' {
            [CompletionResult]::new('info', 'info', [CompletionResultType]::ParameterValue, 'Check a mesh and print its statistics; of a surface, whether it can be filled')
            [CompletionResult]::new('convert', 'convert', [CompletionResultType]::ParameterValue, 'Convert a mesh or a surface between formats, which the file endings determine. Surface formats (.obj, .stl, .ply, .off, .glb, .gltf) get the boundary of a mesh')
            [CompletionResult]::new('tetrahedralize', 'tetrahedralize', [CompletionResultType]::ParameterValue, 'Fill a closed triangle surface with tets')
            [CompletionResult]::new('generate', 'generate', [CompletionResultType]::ParameterValue, 'Generate a shape of longest side 1')
            [CompletionResult]::new('help', 'help', [CompletionResultType]::ParameterValue, 'Print this message or the help of the given subcommand(s)')
            break
        }
        'incise;mesh;help;info' {
            break
        }
        'incise;mesh;help;convert' {
            break
        }
        'incise;mesh;help;tetrahedralize' {
            break
        }
        'incise;mesh;help;generate' {
            break
        }
        'incise;mesh;help;help' {
            break
        }
        'incise;completions' {
            [CompletionResult]::new('-h', '-h', [CompletionResultType]::ParameterName, 'Print help')
            [CompletionResult]::new('--help', '--help', [CompletionResultType]::ParameterName, 'Print help')
            break
        }
        'incise;man' {
            [CompletionResult]::new('-h', '-h', [CompletionResultType]::ParameterName, 'Print help')
            [CompletionResult]::new('--help', '--help', [CompletionResultType]::ParameterName, 'Print help')
            break
        }
        'incise;help' {
            [CompletionResult]::new('run', 'run', [CompletionResultType]::ParameterValue, 'Simulate a scene and write reports, surfaces and images')
            [CompletionResult]::new('advise', 'advise', [CompletionResultType]::ParameterValue, 'Find the most accurate solver settings for a time budget on this machine')
            [CompletionResult]::new('color', 'color', [CompletionResultType]::ParameterValue, 'Cluster and color the constraints of a mesh or the vertices of a graph')
            [CompletionResult]::new('scene', 'scene', [CompletionResultType]::ParameterValue, 'Print the keys of scene files, or validate a scene')
            [CompletionResult]::new('sweep', 'sweep', [CompletionResultType]::ParameterValue, 'Run a scene for all combinations of values of its keys, and write one table')
            [CompletionResult]::new('mesh', 'mesh', [CompletionResultType]::ParameterValue, 'Inspect, convert and generate meshes')
            [CompletionResult]::new('completions', 'completions', [CompletionResultType]::ParameterValue, 'Print completions for a shell')
            [CompletionResult]::new('man', 'man', [CompletionResultType]::ParameterValue, 'Write manual pages, one for each command')
            [CompletionResult]::new('help', 'help', [CompletionResultType]::ParameterValue, 'Print this message or the help of the given subcommand(s)')
            break
        }
        'incise;help;run' {
            break
        }
        'incise;help;advise' {
            break
        }
        'incise;help;color' {
            break
        }
        'incise;help;scene' {
            break
        }
        'incise;help;sweep' {
            break
        }
        'incise;help;mesh' {
            [CompletionResult]::new('info', 'info', [CompletionResultType]::ParameterValue, 'Check a mesh and print its statistics; of a surface, whether it can be filled')
            [CompletionResult]::new('convert', 'convert', [CompletionResultType]::ParameterValue, 'Convert a mesh or a surface between formats, which the file endings determine. Surface formats (.obj, .stl, .ply, .off, .glb, .gltf) get the boundary of a mesh')
            [CompletionResult]::new('tetrahedralize', 'tetrahedralize', [CompletionResultType]::ParameterValue, 'Fill a closed triangle surface with tets')
            [CompletionResult]::new('generate', 'generate', [CompletionResultType]::ParameterValue, 'Generate a shape of longest side 1')
            break
        }
        'incise;help;mesh;info' {
            break
        }
        'incise;help;mesh;convert' {
            break
        }
        'incise;help;mesh;tetrahedralize' {
            break
        }
        'incise;help;mesh;generate' {
            break
        }
        'incise;help;completions' {
            break
        }
        'incise;help;man' {
            break
        }
        'incise;help;help' {
            break
        }
    })

    $completions.Where{ $_.CompletionText -like "$wordToComplete*" } |
        Sort-Object -Property ListItemText
}
