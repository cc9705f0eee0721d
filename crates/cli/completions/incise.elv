
use builtin;
use str;

set edit:completion:arg-completer[incise] = {|@words|
    fn spaces {|n|
        builtin:repeat $n ' ' | str:join ''
    }
    fn cand {|text desc|
        edit:complex-candidate $text &display=$text' '(spaces (- 14 (wcswidth $text)))$desc
    }
    var command = 'incise'
    for word $words[1..-1] {
        if (str:has-prefix $word '-') {
            break
        }
        set command = $command';'$word
    }
    var completions = [
        &'incise'= {
            cand -h 'Print help (see more with ''--help'')'
            cand --help 'Print help (see more with ''--help'')'
            cand -V 'Print version'
            cand --version 'Print version'
            cand run 'Simulate a scene and write reports, surfaces and images'
            cand advise 'Find the most accurate solver settings for a time budget on this machine'
            cand color 'Cluster and color the constraints of a mesh or the vertices of a graph'
            cand scene 'Print the keys of scene files, or validate a scene'
            cand sweep 'Run a scene for all combinations of values of its keys, and write one table'
            cand mesh 'Inspect, convert and generate meshes'
            cand completions 'Print completions for a shell'
            cand man 'Write manual pages, one for each command'
            cand help 'Print this message or the help of the given subcommand(s)'
        }
        &'incise;run'= {
            cand --mesh 'Use this mesh for the scene''s first body'
            cand --frames 'Number of frames [default: 200, or more if a stroke ends later]'
            cand --backend 'Compute device; auto takes a hardware GPU if one supports the scene [default: that of the scene]'
            cand --precision 'Floating-point precision [default: that of the scene]'
            cand --threads 'Number of threads, at most 1024 [default: one for each core]. It does not change the result'
            cand --out 'Folder for the scene, frame reports, surfaces, images and the last mesh'
            cand --jsonl 'Also write one JSON object per frame to this file'
            cand --save-mesh 'Write the last rest mesh to this file; a .vtu file also has the deformed positions'
            cand --animation 'Write an animation: .gif, or .png for an animated PNG'
            cand --fps 'Images of the animation for each second, shown at this rate [default: about 25]'
            cand --size 'Width and height of images in pixels [default: 640x480]'
            cand --view 'Camera: azimuth and elevation in degrees, and zoom; at zoom 1 the bodies fit the image at the start [default: -60,22,1, and the camera steps back where bodies would leave the image]'
            cand --color-by 'Quantity that colors show in images: tissue, color, cluster, piece, stretch or residual. With residual every frame reports it'
            cand --no-pictures 'Write no images and no contact sheet'
            cand --wireframe 'Draw the edges of triangles'
            cand --check 'Validate all derived data after every cut (slow)'
            cand --keep-going 'Continue if the solution diverges; without this the run ends there with exit code 1'
            cand --quiet 'Print only errors; warnings are in frames.jsonl'
            cand -h 'Print help (see more with ''--help'')'
            cand --help 'Print help (see more with ''--help'')'
        }
        &'incise;advise'= {
            cand --budget-ms 'Largest computing time of a frame in ms'
            cand --frames 'Number of frames that are measured, from the first on [default: half a second and all strokes and attachments, at most 100]'
            cand --threads 'Number of threads, at most 1024 [default: one for each core]'
            cand --json 'Print one JSON object instead of text'
            cand -h 'Print help'
            cand --help 'Print help'
        }
        &'incise;color'= {
            cand --algorithm 'The coloring: auto, scgc, jones-plassmann, ecl-gc, vivace, wlc, mcs, greedy, dsatur, iterated-greedy or tabu'
            cand --clustering 'The clustering: none, serial:K, serial-loose:K, greedy-k:K or pressure:K'
            cand --backend 'Compute device; gpu supports jones-plassmann, ecl-gc, scgc, vivace and wlc'
            cand --seed 'Seed of vivace, greedy:random, iterated-greedy and tabu; the others use none'
            cand --balance 'Balance the colors by clusters or by constraints without adding any'
            cand --csv 'Write the cluster and color of each constraint (of a graph: of each vertex) to this CSV file'
            cand --json 'Print one JSON object instead of a table'
            cand -h 'Print help (see more with ''--help'')'
            cand --help 'Print help (see more with ''--help'')'
        }
        &'incise;scene'= {
            cand --check 'Validate a scene without running it'
            cand --defaults 'Print a commented scene with every default'
            cand --schema 'Print the JSON Schema of scene files'
            cand --reference 'Print the reference of all keys in Markdown'
            cand -h 'Print help'
            cand --help 'Print help'
        }
        &'incise;sweep'= {
            cand --set 'A key of the scene and its values, separated by commas. Several keys give all combinations'
            cand --frames 'Number of frames of each run [default: 200, or more if a stroke ends later]'
            cand --out 'Folder of the results; a study continues from what it holds'
            cand --shard 'Run one share of the combinations, as 2/5 for the second of five, and write no table'
            cand --merge 'Run nothing: collect the shares in these folders, and write the table. A missing combination is an error'
            cand --threads 'Number of threads, at most 1024 [default: one for each core]'
            cand --partial 'Write the table without missing combinations'
            cand --quiet 'Print only errors'
            cand -h 'Print help'
            cand --help 'Print help'
        }
        &'incise;mesh'= {
            cand -h 'Print help'
            cand --help 'Print help'
            cand info 'Check a mesh and print its statistics; of a surface, whether it can be filled'
            cand convert 'Convert a mesh or a surface between formats, which the file endings determine. Surface formats (.obj, .stl, .ply, .off, .glb, .gltf) get the boundary of a mesh'
            cand tetrahedralize 'Fill a closed triangle surface with tets'
            cand generate 'Generate a shape of longest side 1'
            cand help 'Print this message or the help of the given subcommand(s)'
        }
        &'incise;mesh;info'= {
            cand --young-modulus 'Young''s modulus in Pa, for the number of substeps'
            cand --density 'Mass density in kg/m³, for the number of substeps'
            cand --time-step 'Time of a frame in s, for the number of substeps'
            cand --json 'Print one JSON object instead of tables'
            cand -h 'Print help'
            cand --help 'Print help'
        }
        &'incise;mesh;convert'= {
            cand --repair 'Merge coincident particles, remove degenerate and duplicate tets, reorient inverted ones, keep the largest piece and its particles; prints the changes'
            cand -h 'Print help'
            cand --help 'Print help'
        }
        &'incise;mesh;tetrahedralize'= {
            cand --tets 'Wanted number of tets; the result is within 2%'
            cand --levels 'Number of times that tets deep inside may be doubled in size, which leaves more for the surface'
            cand -h 'Print help'
            cand --help 'Print help'
        }
        &'incise;mesh;generate'= {
            cand --tets 'Wanted number of tets; the result is within 2%'
            cand -h 'Print help'
            cand --help 'Print help'
        }
        &'incise;mesh;help'= {
            cand info 'Check a mesh and print its statistics; of a surface, whether it can be filled'
            cand convert 'Convert a mesh or a surface between formats, which the file endings determine. Surface formats (.obj, .stl, .ply, .off, .glb, .gltf) get the boundary of a mesh'
            cand tetrahedralize 'Fill a closed triangle surface with tets'
            cand generate 'Generate a shape of longest side 1'
            cand help 'Print this message or the help of the given subcommand(s)'
        }
        &'incise;mesh;help;info'= {
        }
        &'incise;mesh;help;convert'= {
        }
        &'incise;mesh;help;tetrahedralize'= {
        }
        &'incise;mesh;help;generate'= {
        }
        &'incise;mesh;help;help'= {
        }
        &'incise;completions'= {
            cand -h 'Print help'
            cand --help 'Print help'
        }
        &'incise;man'= {
            cand -h 'Print help'
            cand --help 'Print help'
        }
        &'incise;help'= {
            cand run 'Simulate a scene and write reports, surfaces and images'
            cand advise 'Find the most accurate solver settings for a time budget on this machine'
            cand color 'Cluster and color the constraints of a mesh or the vertices of a graph'
            cand scene 'Print the keys of scene files, or validate a scene'
            cand sweep 'Run a scene for all combinations of values of its keys, and write one table'
            cand mesh 'Inspect, convert and generate meshes'
            cand completions 'Print completions for a shell'
            cand man 'Write manual pages, one for each command'
            cand help 'Print this message or the help of the given subcommand(s)'
        }
        &'incise;help;run'= {
        }
        &'incise;help;advise'= {
        }
        &'incise;help;color'= {
        }
        &'incise;help;scene'= {
        }
        &'incise;help;sweep'= {
        }
        &'incise;help;mesh'= {
            cand info 'Check a mesh and print its statistics; of a surface, whether it can be filled'
            cand convert 'Convert a mesh or a surface between formats, which the file endings determine. Surface formats (.obj, .stl, .ply, .off, .glb, .gltf) get the boundary of a mesh'
            cand tetrahedralize 'Fill a closed triangle surface with tets'
            cand generate 'Generate a shape of longest side 1'
        }
        &'incise;help;mesh;info'= {
        }
        &'incise;help;mesh;convert'= {
        }
        &'incise;help;mesh;tetrahedralize'= {
        }
        &'incise;help;mesh;generate'= {
        }
        &'incise;help;completions'= {
        }
        &'incise;help;man'= {
        }
        &'incise;help;help'= {
        }
    ]
    $completions[$command]
}
