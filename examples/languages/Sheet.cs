// A sheet of two charts with eight painted discs, in 48 poses: a preview in which the newest pose wins, then each pose
// exactly, with its map and a stud. README.md says what is printed.
using System;
using System.Collections.Generic;
using System.Globalization;
using System.Linq;
using Vrtm;
using static Vrtm.Api;

internal static unsafe class Sheet
{
    private const int Poses = 48, Cells = 20, Line = Cells + 1, Texels = 128;
    private const double Radius = .15;

    private static double Distance(double[] a, double[] b) => Math.Sqrt(a.Zip(b, (x, y) => (x - y) * (x - y)).Sum());

    /// <summary>The place on the sheet at rest, of 2 x 1, that has a UV: each half is a chart.</summary>
    private static double[] AtRest(double u, double v)
    {
        var chart = u < .5 ? 0 : 1;
        return new[] { chart + (u - .04 - .48 * chart) / .44, (v - .28) / .44, 0 };
    }

    private static double[] Posed(double[] rest, int pose)
    {
        double x = rest[0], y = rest[1], s = pose / (Poses - 1.0);
        return new[] { x + .15 * s * x * (x - 1), y - .2 * s * x * y * (1 - y), .3 * s * x * (2 - x) };
    }

    /// <summary>True within so many units from the centre of the nearest of the four discs of a chart.</summary>
    private static bool InDisc(double u, double v, double within)
    {
        var rest = AtRest(u, v);
        double x = Math.Abs(rest[0] - (u < .5 ? 0 : 1) - .5) - .25, y = Math.Abs(rest[1] - .5) - .25;
        return x * x + y * y < within * within;
    }

    private static float[] Positions(int pose)
    {
        Func<int, double> at = k => k % Line / (double)Cells;
        var vertices = Enumerable.Range(0, 2 * Line * Line);
        var points = vertices.SelectMany(k => Posed(new[] { k / (Line * Line) + at(k), at(k / Line) }, pose));
        return points.Select(x => (float)x).ToArray();
    }

    /// <summary>The RMS strain of the discs: lengths between neighbouring texels in the pose, over those of what they
    /// show.</summary>
    private static double Strain(float[] map, int pose)
    {
        double sum = 0, step = 1.0 / Texels;
        var count = 0;
        for (var k = 0; k < Texels * (Texels - 1); k++)
        {
            var (x, y) = (k % Texels, k / Texels);
            for (var dx = 0; dx < 2 && x + 1 < Texels; dx++)
            {
                int dy = 1 - dx, a = 2 * k, b = 2 * (k + dy * Texels + dx);
                if (InDisc(map[a], map[a + 1], .13) && InDisc(map[b], map[b + 1], .13))
                {
                    double u = (x + .5) * step, v = 1 - (y + .5) * step;
                    var now = Distance(Posed(AtRest(u, v), pose), Posed(AtRest(u + dx * step, v - dy * step), pose));
                    sum += Math.Pow(now / Distance(AtRest(map[a], map[a + 1]), AtRest(map[b], map[b + 1])) - 1, 2);
                    count++;
                }
            }
        }
        return Math.Sqrt(sum / count);
    }

    private static void Main()
    {
        CultureInfo.CurrentCulture = CultureInfo.InvariantCulture;
        var corners = new List<uint>();
        var uvs = new List<float>();
        for (var k = 0; k < 2 * Line * Line; k++)
        {
            int i = k % Line, j = k / Line % Line, chart = k / (Line * Line);
            uvs.Add((float)(.04 + .48 * chart + .44 * i / Cells));
            uvs.Add((float)(.28 + .44 * j / Cells));
            if (i < Cells && j < Cells)
            {
                corners.AddRange(Array.ConvertAll(new[] { k, k + 1, k + Line + 1, k + Line }, vertex => (uint)vertex));
            }
        }
        var own = new float[2 * Texels * Texels];
        var painted = new byte[Texels * Texels];
        for (var k = 0; k < painted.Length; k++)
        {
            double u = (k % Texels + .5) / Texels, v = 1 - (k / Texels + .5) / Texels;
            own[2 * k] = (float)u;
            own[2 * k + 1] = (float)v;
            painted[k] = (byte)(InDisc(u, v, Radius) ? 255 : 0);
        }

        var counts = Enumerable.Repeat(4u, 2 * Cells * Cells).ToArray();
        var indices = corners.ToArray();
        using (var asset = new Asset(Positions(0), counts, indices, uvs.ToArray(), indices,
            log: (entry, message) => Console.Error.WriteLine(message)))
        {
            asset.SetRigidity(1001, painted, Texels, Texels);
            var settings = asset.GetSettings(1001);
            settings.grid_width = settings.grid_height = 96;
            asset.SetSettings(1001, settings);

            // A stud: its tip over the middle of the first disc, and two places on its rim.
            vrtm_carrier stud;
            fixed (float* at = new[] { .15f, .39f, .2f, .39f, .15f, .44f }, heights = new[] { .1f, 0, 0 })
            {
                vrtm_array places = vrtm_array.Init(), above = vrtm_array.Init();
                places.data = at;
                above.data = heights;
                places.count = above.count = (UIntPtr)3;
                var bound = vrtm_carrier_desc.Init();
                bound.uvs = &places;
                bound.heights = &above;
                Asset.Check(vrtm_carrier_create(asset.Handle, &bound, &stud));
            }

            // As fast as the mouse moves: each pose takes the place of the one before.
            var preview = vrtm_solve_options.Init();
            preview.quality = VRTM_QUALITY_DRAFT;
            preview.replace = 1;
            Job newest = null;
            for (var pose = 0; pose < Poses; pose++)
            {
                var next = asset.Submit(Positions(pose), preview);
                newest?.Dispose();
                newest = next;
            }
            newest.Wait();
            newest.Dispose();
            Console.WriteLine($"preview {asset.Report(1001).min_jacobian:F4}");

            var map = new float[Map.Length(VRTM_FETCH_REDIRECTION, Texels, Texels)];
            var image = new Map { Udim = 1001, Kind = VRTM_FETCH_REDIRECTION, Values = map };
            image.Width = image.Height = Texels;
            var to = vrtm_array_out.Init();
            to.count = (UIntPtr)3;
            var carried = vrtm_carried.Init();
            carried.positions = &to;
            var points = new float[3 * 3];
            for (var pose = 0; pose < Poses; pose++)
            {
                asset.Redirect(Positions(pose), vrtm_solve_options.Init(), image);
                fixed (float* data = points)
                {
                    to.data = data;
                    Asset.Check(vrtm_carrier_fetch(stud, &carried));
                }
                if (pose % 8 == 0 || pose == Poses - 1)
                {
                    var shown = 2 * (78 * Texels + 19);
                    double[] at = Array.ConvertAll(points, x => (double)x), rim = { at[3], at[4], at[5] };
                    Console.WriteLine($"{pose,2}  {Strain(own, pose):F4} {Strain(map, pose):F4}  {map[shown]:F4} " +
                        $"{map[shown + 1]:F4}  {at[0]:F4} {at[1]:F4} {at[2]:F4}  {Distance(at, rim):F4}");
                }
            }
            Asset.Check(vrtm_carrier_destroy(stud));
        }
    }
}
