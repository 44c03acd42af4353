// What the tests of FirnHeightfield.cs drive. Plain .NET, no Unity.
//
//     decode HEX            prints a message's tiles, or what is wrong with it
//     follow SERVER SESSION prints a line for every new state: seq, recovered, width, depth, heights in millimetres
//     ground SERVER SESSION the same, with the ground in tenths of a millimetre
//     watch SERVER SESSION  prints a line whenever the mean depth of the first tile has crossed 1.5 m

using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Threading;
using Firn;

static class Program
{
    static int Main(string[] arguments)
    {
        if (arguments[0] == "decode") return Decode(arguments[1]);
        var terrain = arguments[0] == "ground";
        var snow = new Heightfield(new Uri(arguments[1]), arguments[2], maxRate: 60, terrain: terrain);
        var watches = arguments[0] == "watch";
        if (watches) snow.Watches.Add(new DepthWatch { Id = "deep", Width = 8, Depth = 8, Above = 1.5 });
        var running = snow.RunAsync(CancellationToken.None);
        while (!running.IsCompleted)
        {
            if (snow.Poll() && !watches) Print(snow);
            WatchEvent told;
            while (snow.PollWatch(out told)) Print(told);
            Thread.Sleep(5); // until a game's next frame
        }
        Console.WriteLine("ended " + running.Exception.InnerException.Message);
        return 0;
    }

    static void Print(Heightfield snow)
    {
        var heights = snow.Heights.Select(height => Math.Round(height * 1000))
            .Concat(snow.Ground.Select(elevation => Math.Round(elevation * 10000)));
        Console.WriteLine("{0} {1} {2} {3} {4}", snow.Seq, snow.Recovered?.ToString() ?? "-", snow.Width, snow.Depth,
            string.Join(" ", heights));
        Console.Out.Flush();
    }

    static void Print(WatchEvent told)
    {
        Console.WriteLine("{0} {1} {2} {3}", told.Seq, told.Id, told.Holds, Math.Round(told.MeanDepth * 1000));
        Console.Out.Flush();
    }

    static void Print(int x, int z, int width, int depth, IEnumerable<object> samples)
    {
        Console.WriteLine("{0} {1} {2} {3} {4}", x, z, width, depth, string.Join(" ", samples));
    }

    static int Decode(string hex)
    {
        var bytes = Enumerable.Range(0, hex.Length / 2).Select(i => Convert.ToByte(hex.Substring(2 * i, 2), 16)).ToArray();
        try
        {
            var message = new HeightMessage(bytes);
            Console.WriteLine("{0} {1} {2} {3} {4} {5} {6} {7}", message.Snapshot ? "snapshot" : "delta", message.Id, message.Seq,
                message.Tick, message.Recovered?.ToString() ?? "-", message.More, message.Level, message.Stride);
            message.ReadTiles(
                (x, z, width, depth, heights) => Print(x, z, width, depth, heights.Take(width * depth).Cast<object>()),
                (x, z, width, depth, heights) =>
                    Print(x, z, width, depth, heights.Take(width * depth).Select(elevation => (object)(int)elevation)));
            return 0;
        }
        catch (InvalidDataException error)
        {
            Console.WriteLine(error.Message);
            return 1;
        }
    }
}
