// What the tests of FirnHeightfield.cs and FirnObjects.cs drive. Plain .NET, no Unity.
//
//     decode HEX            prints a message's tiles, or what is wrong with it
//     follow SERVER SESSION prints a line for every new state: seq, recovered, width, depth, heights in millimetres
//     ground SERVER SESSION the same, with the ground in tenths of a millimetre
//     watch SERVER SESSION  prints a line whenever the mean depth of the first tile has crossed 1.5 m
//     objects SERVER SESSION changes an object as standard input says, and prints it with each answer and in every new state

using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Linq;
using System.Threading;
using Firn;

static class Program
{
    static int Main(string[] arguments)
    {
        if (arguments[0] == "decode") return Decode(arguments[1]);
        if (arguments[0] == "objects") return Objects(new Heightfield(new Uri(arguments[1]), arguments[2], maxRate: 60, colliders: true));
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

    static int Objects(Heightfield snow)
    {
        var running = snow.RunAsync(CancellationToken.None);
        while (!snow.Poll()) Thread.Sleep(5);
        new Thread(() => { for (string line; (line = Console.ReadLine()) != null;) Change(snow, line.Split(' ')); }) { IsBackground = true }.Start();
        while (!running.IsCompleted)
        {
            if (snow.Poll()) foreach (var it in Collider.ReadAll(snow.Colliders)) Print("told", it);
            Thread.Sleep(5);
        }
        return 0;
    }

    /// <summary>Does a line of a command, an id and numbers.</summary>
    static void Change(Heightfield snow, string[] words)
    {
        var numbers = words.Skip(2).Select(word => double.Parse(word, CultureInfo.InvariantCulture)).ToArray();
        try
        {
            switch (words[0])
            {
                case "put":
                    Print("done", snow.PutAsync(words[1], new ColliderFields { Mass = numbers[0], Shape = Shapes.Box(numbers[1], numbers[1]),
                        Position = new Point(numbers[2], numbers[3]), Shelters = numbers[4] > 0 }).Result);
                    break;
                case "velocity":
                    Print("done", snow.PatchAsync(words[1], new ColliderFields { Velocity = new Point(numbers[0], numbers[1]),
                        TurnRate = numbers[2] }).Result);
                    break;
                case "path":
                    Print("done", snow.PatchAsync(words[1], new ColliderFields { Path = new[] { new Point(numbers[0], numbers[1]) },
                        Over = numbers[2] }).Result);
                    break;
                case "sweep":
                    Print("done", snow.PatchAsync(words[1], new ColliderFields { Position = new Point(numbers[0], numbers[1]),
                        Heading = numbers[2], Sweep = true }).Result);
                    break;
                case "delete":
                    snow.DeleteAsync(words[1]).Wait();
                    Console.WriteLine("gone");
                    break;
            }
        }
        catch (AggregateException error) { Console.WriteLine(error.InnerException.GetType().Name + " " + error.InnerException.Message); }
        Console.Out.Flush();
    }

    static void Print(string what, Collider it)
    {
        Console.WriteLine(string.Format(CultureInfo.InvariantCulture,
            "{0} {1} {2:0.###} {3:0.###} {4:0.###} {5:0.###} {6:0.###} {7:0.###} {8} {9:0.##} {10} {11} {12:0.###}",
            what, it.Id, it.Position.X, it.Position.Z, it.Heading, it.Velocity.X, it.Velocity.Z, it.TurnRate, it.Path.Count, it.Speed ?? -1,
            it.TurnTo ?? -1, it.Shelters, it.Burden));
        Console.Out.Flush();
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
