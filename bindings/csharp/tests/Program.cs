// Tests Vrtm.cs and Asset.cs, and the component for Unity with stand-ins of its classes. Prints a line per test, and
// the count as cargo does.
using System;
using System.IO;
using System.Linq;
using System.Reflection;
using System.Threading;
using System.Threading.Tasks;
using UnityEngine;
using Vrtm;
using static Vrtm.Api;

internal static unsafe class Program
{
    // Two squares side by side, one stretched and one squashed, and a feature in the middle.
    private static readonly float[] Rest = { 0, 0, 0, 1, 0, 0, 2, 0, 0, 0, 1, 0, 1, 1, 0, 2, 1, 0 };
    private static readonly float[] Pose = { 0, 0, 0, 1.3f, 0, 0, 2, 0, 0, 0, 1, 0, 1.3f, 1, 0, 2, 1, 0 };
    private static readonly float[] Uvs = { 0, 0, .5f, 0, 1, 0, 0, 1, .5f, 1, 1, 1 };
    private static readonly uint[] Corners = { 0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4 };
    private const int Size = 32;
    private static int passed, failed;

    private static readonly byte[] Painted = Enumerable.Range(0, Size * Size)
        .Select(k => (byte)(Math.Abs(k % Size - 15.5) < 4 && Math.Abs(k / Size - 15.5) < 4 ? 255 : 0)).ToArray();

    // Larger by so much that the library warns.
    private static readonly float[] Far = Array.ConvertAll(Pose, value => 5 * value);

    /// <summary>Holds a solve in its log, while it prepares a grid, until it is opened.</summary>
    private sealed class Gate
    {
        private readonly ManualResetEvent held = new ManualResetEvent(false), opened = new ManualResetEvent(false);

        public void Log(vrtm_log_entry entry, string message)
        {
            if (entry.code == VRTM_LOG_CODE_GRID)
            {
                Hold();
                throw new Exception("it does not reach the library");
            }
        }

        public void Hold()
        {
            held.Set();
            opened.WaitOne();
        }

        public void Open() => opened.Set();

        public bool IsHeld => held.WaitOne(60000);
    }

    private static Asset Made(Log log = null, float[] uvs = null)
    {
        var asset = new Asset(Rest, null, Corners, uvs ?? Uvs, Corners, weldByPosition: true, log: log);
        asset.SetRigidity(1001, Painted, Size, Size);
        return asset;
    }

    private static void Test(string name, Action body)
    {
        try
        {
            body();
            passed++;
            Console.WriteLine($"test csharp {name} ... ok");
        }
        catch (Exception error)
        {
            failed++;
            Console.WriteLine($"test csharp {name} ... FAILED\n{error}");
        }
    }

    private static void That(bool holds, string what)
    {
        if (!holds)
        {
            throw new Exception(what);
        }
    }

    private static void Fails<T>(string message, Action body, int status = 0) where T : Exception
    {
        try
        {
            body();
        }
        catch (T error) when (error.Message.Contains(message))
        {
            That(status == 0 || (error as VrtmException).Status == status, error.ToString());
            return;
        }
        throw new Exception("no error with: " + message);
    }

    private static void Feature()
    {
        using (var asset = Made())
        {
            var options = vrtm_solve_options.Init();
            options.measure = 1;
            asset.Solve(Pose, options);
            var report = asset.Report(1001);
            That(report.folds == 0 && report.min_jacobian > 0, "certified");
            That(report.after.rms < .02f && report.before.rms > .2f, $"strain {report.after.rms}");
            That(report.features > 0 && report.features_worse == asset.WorstFeatures(1001).Length, "counted");
            var uvs = Fetched(asset);
            var halves = new ushort[2 * Size * Size];
            asset.FetchDelta(1001, halves, Size, Size);
            var (x, y) = (16, 16);
            var moved = uvs[2 * (y * Size + x)] - (x + .5f) / Size;
            // The first row is v = 0 here.
            var half = Half(halves[2 * ((Size - 1 - y) * Size + x)]);
            That(Math.Abs(moved) > .01f && Math.Abs(half - moved) < 1e-4f, $"{moved} and {half}");
            // A frame of a component's thread allocates nothing.
            asset.Solve(Rest);
            asset.FetchDelta(1001, halves, Size, Size);
            var bytes = GC.GetAllocatedBytesForCurrentThread();
            asset.Solve(Pose);
            asset.FetchDelta(1001, halves, Size, Size);
            That(GC.GetAllocatedBytesForCurrentThread() == bytes, "a solve allocates");
            asset.Solve(Pose, draft: true);
            That(!Fetched(asset).SequenceEqual(uvs), "a draft");
        }
    }

    private static float Half(ushort bits)
    {
        // The exponent is smaller by 112 until the product.
        var wide = (bits & 0x8000) << 16 | (bits & 0x7fff) << 13;
        return *(float*)&wide * 5.192296858534828e33f;
    }

    private static float[] Fetched(Asset asset)
    {
        var uvs = new float[2 * Size * Size];
        asset.FetchRedirection(1001, uvs, Size, Size);
        return uvs;
    }

    private static void Maps()
    {
        using (var asset = Made())
        {
            // Of one solve, each with the size that its kind has.
            var kinds = new[] { VRTM_FETCH_REDIRECTION, VRTM_FETCH_JACOBIAN, VRTM_FETCH_FILTER_SCALE };
            var maps = Array.ConvertAll(kinds, kind => new Map
            {
                Udim = 1001, Kind = kind, Width = Size, Height = Size, Values = new float[Map.Length(kind, Size, Size)],
            });
            asset.Redirect(Pose, vrtm_solve_options.Init(), maps);
            var uvs = Fetched(asset);
            That(uvs.SequenceEqual((float[])maps[0].Values), "as one alone");
            That(Array.Exists((float[])maps[2].Values, factor => factor > 1.01f), "a filter's scale");
            maps[1].Values = uvs;
            Fails<ArgumentException>("values for 32 x 32 texels of 4", () => asset.Fetch(maps));
            maps[1].Values = new int[Map.Length(VRTM_FETCH_JACOBIAN, Size, Size)];
            Fails<ArgumentException>("neither float[] nor ushort[]", () => asset.Fetch(maps));
            Fails<ArgumentException>("uvs: 3 values", () => asset.FetchCornerUvs(new float[3]));
            var corners = new float[2 * asset.Info.corners];
            asset.FetchCornerUvs(corners);
            That(corners[2] == .5f, "a corner at the border");
        }
    }

    /// <summary>A gate for the next solve, which has to prepare another grid.</summary>
    private static Gate Closed(Asset asset, uint cells)
    {
        var settings = asset.GetSettings(1001);
        settings.grid_width = settings.grid_height = cells;
        asset.SetSettings(1001, settings);
        return new Gate();
    }

    private static void Jobs()
    {
        Gate gate = null;
        using (var asset = Made((entry, message) => gate?.Log(entry, message)))
        {
            GC.Collect();
            var options = vrtm_solve_options.Init();
            asset.Submit(Pose, options).WaitAsync().Wait();
            var before = Fetched(asset);
            var source = new CancellationTokenSource();
            gate = Closed(asset, 64);
            var job = asset.Submit(Pose, options);
            var task = job.WaitAsync(source.Token);
            That(gate.IsHeld && !job.Wait(0) && job.Progress.state == VRTM_JOB_RUNNING, "it runs");
            Fails<VrtmException>("", () => asset.Submit(Rest, options), VRTM_ERROR_BUSY);
            source.Cancel();
            gate.Open();
            Fails<VrtmException>("", () => task.GetAwaiter().GetResult(), VRTM_ERROR_CANCELLED);
            That(Fetched(asset).SequenceEqual(before), "the last result stays");
            // Cancelled and waited for, so that the asset is not busy.
            gate = Closed(asset, 128);
            job = asset.Submit(Pose, options);
            That(gate.IsHeld, "it runs again");
            var ended = Task.Run(() => job.Dispose());
            gate.Open();
            ended.Wait();
            asset.Solve(Pose);
        }
    }

    /// <summary>Refinements, by the generated functions.</summary>
    private static void Generated()
    {
        var errors = Console.Error;
        using (var asset = Made())
        {
            asset.Solve(Pose);
            vrtm_refinement refinement;
            Asset.Check(vrtm_refinement_create(asset.Handle, null, &refinement));
            var info = vrtm_refinement_info.Init();
            Asset.Check(vrtm_refinement_get_info(refinement, &info));
            That(info.triangles > 4, $"{info.triangles} triangles");
            Asset.Check(vrtm_refinement_destroy(refinement));
            // Without a log, warnings go to the console's errors.
            var said = new StringWriter();
            Console.SetError(said);
            asset.Solve(Far);
            Console.SetError(errors);
            That(said.ToString().StartsWith("vrtm: "), "a warning in the console");
        }
    }

    private static void Defaults()
    {
        That(vrtm_mesh_desc.Init().weld_uv_tolerance == 1.0 / 2048, "weld_uv_tolerance");
        That(vrtm_solve_options.Init().pbd.iterations == 16 && vrtm_solve_options.Init().pbd.smoothing == .8f, "pbd");
        That(vrtm_tile_settings.Init().struct_size == sizeof(vrtm_tile_settings), "struct_size");
        That(sizeof(vrtm_adapter_info) > 300, "names are part of the struct");
    }

    private static void Errors()
    {
        Fails<ArgumentNullException>("uvs", () => new Asset(Rest, null, Corners, null));
        Fails<ArgumentException>("positions: 17 numbers are no multiple of 3", () => new Asset(new float[17], null, Corners, Uvs));
        Fails<VrtmException>("indices", () => new Asset(Rest, new uint[] { 4, 4 }, new uint[] { 0, 1, 4, 3, 1, 2, 5, 9 }, Uvs, Corners));
        using (var asset = Made())
        {
            Fails<VrtmException>("", () => asset.Report(1001));
            asset.Solve(Pose);
            var before = Fetched(asset);
            Fails<ArgumentException>("values: 7 values for 3 x 2 texels", () => asset.SetRigidity(1001, new byte[7], 3, 2));
            Fails<ArgumentException>("positions: 3 numbers for 6 vertices", () => asset.Solve(new float[3]));
            Fails<VrtmException>("", () => asset.Solve(new float[] { float.NaN, 0, 0, 1, 0, 0, 2, 0, 0, 0, 1, 0, 1, 1, 0, 2, 1, 0 }));
            Fails<VrtmException>("1044", () => asset.SetRigidity(1044, Painted, Size, Size));
            Fails<ArgumentException>("halves: 4 values", () => asset.FetchDelta(1001, new ushort[4], 2, 2));
            That(Fetched(asset).SequenceEqual(before), "the last result");
            asset.Dispose();
            asset.Dispose();
            Fails<VrtmException>("", () => asset.Solve(Pose));
        }
    }

    private static void Call(object component, string name) =>
        component.GetType().GetMethod(name, BindingFlags.Instance | BindingFlags.NonPublic).Invoke(component, null);

    private static Vector3[] Points(float[] flat) => Enumerable.Range(0, flat.Length / 3)
        .Select(k => new Vector3 { x = flat[3 * k], y = flat[3 * k + 1], z = flat[3 * k + 2] }).ToArray();

    /// <summary>A component that has started, beside a renderer whose transform has a scale.</summary>
    private static VrtmSkin Started(float scale, Texture2D rigidity, float[] uvs = null)
    {
        uvs = uvs ?? Uvs;
        var uv = Enumerable.Range(0, 6).Select(k => new Vector2 { x = uvs[2 * k], y = uvs[2 * k + 1] });
        var triangles = Array.ConvertAll(Corners, corner => (int)corner);
        var mesh = new Mesh { vertices = Points(Rest), uv = uv.ToArray(), triangles = triangles };
        var skinned = new SkinnedMeshRenderer { sharedMesh = mesh, posed = Points(Pose), scale = scale };
        var component =
            new VrtmSkin { name = "Sheet", skinned = skinned, rigidity = rigidity, size = Size, draft = false };
        Call(component, "Start");
        return component;
    }

    private static Texture2D Painting() =>
        new Texture2D(Size, Size) { pixels = Array.ConvertAll(Painted, red => new Color32 { r = red }) };

    private static ushort[] Expected(float[] pose, int scale = VRTM_SCALE_KEEP, float[] uvs = null)
    {
        var options = vrtm_solve_options.Init();
        options.scale = scale;
        using (var asset = Made(uvs: uvs))
        {
            asset.Solve(pose, options);
            var delta = new ushort[2 * Size * Size];
            asset.FetchDelta(1001, delta, Size, Size);
            return delta;
        }
    }

    /// <summary>Frames of a component, until something holds or it ends.</summary>
    private static void Frames(VrtmSkin component, Func<bool> enough)
    {
        while (component.enabled && !enough())
        {
            Call(component, "LateUpdate");
            Thread.Yield();
        }
    }

    private static bool Shows(VrtmSkin component, ushort[] map) =>
        component.skinned.material.texture.shown.SequenceEqual(map);

    private static void Component()
    {
        var component = Started(100, Painting());
        var expected = Expected(Pose);
        That(Shows(component, new ushort[expected.Length]), "no map yet");
        Frames(component, () => !Shows(component, new ushort[expected.Length]));
        That(component.enabled, Debug.error);
        That(Shows(component, expected), "the component's map");
        // Another pose of a larger body, whose features follow it.
        var larger = Array.ConvertAll(Pose, value => 1.5f * (value == 1.3f ? 1.2f : value));
        component.skinned.posed = Points(larger);
        component.scale = VrtmSkin.Sizes.Follow;
        Frames(component, () => !Shows(component, expected));
        That(Shows(component, Expected(larger, VRTM_SCALE_FOLLOW)), "the map of a pose that is followed");
        That(!Shows(component, Expected(larger)), "and of one that is not");
        // Further frames allocate nothing.
        var frame = (Action)Delegate.CreateDelegate(typeof(Action), component, "LateUpdate");
        var before = GC.GetAllocatedBytesForCurrentThread();
        for (var k = 0; k < 100; k++)
        {
            frame();
            Thread.Yield();
        }
        That(GC.GetAllocatedBytesForCurrentThread() == before, "frames allocate");
        // A pose that is not finite ends it with a message.
        component.skinned.posed[0].x = float.NaN;
        Frames(component, () => false);
        That(Debug.error.StartsWith("vrtm, Sheet: ") && Debug.error.Contains("positions"), Debug.error);
        Call(component, "OnDestroy");
    }

    private static void Newest()
    {
        // One half lies over the other: the library warns, which holds the solve.
        var uvs = new[] { 0, 0, .5f, 0, .46f, 0, 0, 1, .5f, 1, .46f, 1 };
        var gate = new Gate();
        Debug.warned = null;
        var component = Started(1, Painting(), uvs);
        component.newestPoseWins = true;
        Debug.warned = gate.Hold;
        component.skinned.posed = Points(Far);
        Call(component, "LateUpdate");
        That(gate.IsHeld && Debug.warning.StartsWith("vrtm, Sheet: "), "no warning");
        component.skinned.posed = Points(Pose);
        Call(component, "LateUpdate");
        Debug.warned = null;
        gate.Open();
        Frames(component, () => !Shows(component, new ushort[2 * Size * Size]));
        That(component.enabled && Shows(component, Expected(Pose, uvs: uvs)), "the newest pose's map comes first");
        Call(component, "OnDestroy");
    }

    private static void Unusable()
    {
        foreach (var map in new[] { null, new Texture2D(Size, Size) { isReadable = false } })
        {
            var component = Started(1, map);
            That(!component.enabled && Debug.error.Contains("rigidity cannot be read"), Debug.error);
            Call(component, "OnDestroy");
        }
    }

    private static int Main()
    {
        Test("a feature keeps its shape", Feature);
        Test("maps of one solve have their sizes", Maps);
        Test("jobs are awaited, cancelled and waited for", Jobs);
        Test("a refinement goes with an asset, and warnings to the console", Generated);
        Test("structs have their sizes and defaults", Defaults);
        Test("errors name the argument and lose nothing", Errors);
        Test("the component for Unity shows the map of its pose", Component);
        Test("the component's newest pose wins, and its warnings are shown", Newest);
        Test("the component says what it cannot use", Unusable);
        Console.WriteLine($"test result: {(failed == 0 ? "ok" : "FAILED")}. {passed} passed; {failed} failed; 0 ignored");
        return failed == 0 ? 0 : 1;
    }
}
