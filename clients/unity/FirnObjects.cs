// Objects on the snow of a Firn session, for Unity 2021 or newer or any other .NET. No packages: copy this file beside FirnHeightfield.cs.
//
//     var snow = new Firn.Heightfield(server, "demo", colliders: true);
//     var at = new Firn.Point(5, 5);
//     await snow.PutAsync("sledge", new Firn.ColliderFields { Mass = 80, Shape = Firn.Shapes.Box(0.5, 1.2), Position = at });
//     await snow.PatchAsync("sledge", new Firn.ColliderFields { Velocity = new Firn.Point(2, 0) }); // it moves by itself
//     await snow.PatchAsync("sledge", new Firn.ColliderFields { Position = at, Sweep = true });     // back, with a track
//     foreach (var it in Firn.Collider.ReadAll(snow.Colliders)) { ... it.Position, it.Burden ... }  // after Poll()
//
// docs/objects.md says how objects move, and how snow lies on them.

using System;
using System.Collections.Generic;
using System.Globalization;
using System.Linq;
using System.Threading.Tasks;

namespace Firn
{
    /// <summary>A horizontal position [m] or velocity [m/s].</summary>
    public struct Point
    {
        public readonly double X, Z;

        public Point(double x, double z)
        {
            X = x;
            Z = z;
        }
    }

    /// <summary>Outlines of objects from above, as JSON. Lengths in metres.</summary>
    public static class Shapes
    {
        public static string Box(double width, double depth) { return Make("box", "width", width, "depth", depth); }
        public static string Disk(double radius) { return "{\"type\":\"disk\",\"radius\":" + Json.Number(radius) + "}"; }
        public static string Capsule(double length, double radius) { return Make("capsule", "length", length, "radius", radius); }
        public static string Wheel(double width, double radius) { return Make("wheel", "width", width, "radius", radius); }

        /// <summary>Convex, with 3 to 16 corners: x to the object's right, z forward.</summary>
        public static string Polygon(IEnumerable<Point> corners)
        {
            return "{\"type\":\"polygon\",\"corners\":" + Json.Points(corners) + "}";
        }

        static string Make(string type, string one, double first, string other, double second)
        {
            return "{\"type\":\"" + type + "\",\"" + one + "\":" + Json.Number(first) + ",\"" + other + "\":" + Json.Number(second) + "}";
        }
    }

    /// <summary>Fields of an object. What is null has its default in a put, and stays as it is in a patch.</summary>
    public sealed class ColliderFields
    {
        /// <summary>Mass [kg].</summary>
        public double? Mass;
        /// <summary>One of Shapes, or JSON; instead, several outlines as a JSON array.</summary>
        public string Shape, Footprints;
        /// <summary>Where its centre is [m]. In a patch without Sweep it is lifted there, and a path ends.</summary>
        public Point? Position;
        /// <summary>Compass bearing of its front [degrees]: 0 along +z, 90 along +x.</summary>
        public double? Heading;
        /// <summary>Whether it is held up and does not press the snow.</summary>
        public bool? Airborne;
        /// <summary>Whether snow that falls on its columns lies on it; true by default.</summary>
        public bool? Shelters;
        /// <summary>Velocity [m/s], at most 100 m/s. In a patch it ends a path.</summary>
        public Point? Velocity;
        /// <summary>How fast it turns [degrees/s], clockwise from above, at most 720.</summary>
        public double? TurnRate;
        /// <summary>1 to 4096 points that it passes in order [m]; Over is the time that it takes for them [s].</summary>
        public IList<Point> Path;
        public double? Over;
        /// <summary>In a patch: whether it is pushed to Position and turned to Heading in the next cycle, and leaves a track.</summary>
        public bool Sweep;

        internal string ToJson(string id)
        {
            var fields = new List<string>();
            Action<string, string> add = (name, value) => { if (value != null) fields.Add("\"" + name + "\":" + value); };
            add("id", id == null ? null : "\"" + id + "\"");
            add("mass", Json.Number(Mass));
            add("shape", Shape);
            add("footprints", Footprints);
            add("position", Json.Point(Position));
            add("heading", Json.Number(Heading));
            add("airborne", Json.Truth(Airborne));
            add("shelters", Json.Truth(Shelters));
            add("velocity", Json.Point(Velocity));
            add("turn_rate", Json.Number(TurnRate));
            add("path", Path == null ? null : Json.Points(Path));
            add("over", Json.Number(Over));
            if (Sweep) add("sweep", "true");
            return "{" + string.Join(",", fields) + "}";
        }
    }

    /// <summary>An object on the snow: how it stands and moves.</summary>
    public sealed class Collider
    {
        public string Id;
        /// <summary>Mass [kg], without the snow on it.</summary>
        public double Mass;
        /// <summary>Where its centre is [m].</summary>
        public Point Position;
        /// <summary>Compass bearing of its front [degrees].</summary>
        public double Heading;
        public bool Airborne, Shelters;
        /// <summary>Velocity [m/s]; 0 where it has none.</summary>
        public Point Velocity;
        /// <summary>How fast it turns [degrees/s].</summary>
        public double TurnRate;
        /// <summary>Points of its path that are still ahead [m]; empty where it follows none.</summary>
        public List<Point> Path;
        /// <summary>Speed along its path [m/s]; null where it has none, or is swept.</summary>
        public double? Speed;
        /// <summary>Heading to which it is swept [degrees]; null where it is not.</summary>
        public double? TurnTo;
        /// <summary>Elevation of its bottom [m], and how far that is below the highest column where it was put or has moved to.</summary>
        public double Bottom, SinkDepth;
        /// <summary>Area in contact [m2] and the pressure on it [Pa].</summary>
        public double ContactArea, Pressure;
        /// <summary>Mass of the snow that lies on it [kg].</summary>
        public double Burden;
        /// <summary>Whether it stands still and has sunk as deep as it will.</summary>
        public bool Resting;

        /// <summary>Reads a JSON array of objects, such as Heightfield.Colliders.</summary>
        public static List<Collider> ReadAll(string json)
        {
            return ((List<object>)Json.Read(json)).ConvertAll(it => new Collider((Dictionary<string, object>)it));
        }

        internal static Collider OfAck(string json)
        {
            return new Collider((Dictionary<string, object>)((Dictionary<string, object>)Json.Read(json))["collider"]);
        }

        Collider(Dictionary<string, object> fields)
        {
            Func<string, object> field = name => { object value; return fields.TryGetValue(name, out value) ? value : null; };
            Func<string, double> number = name => (double)(field(name) ?? 0.0);
            Id = (string)field("id");
            Mass = number("mass");
            Position = PointOf(field("position"));
            Heading = number("heading");
            Airborne = true.Equals(field("airborne"));
            Shelters = true.Equals(field("shelters"));
            Velocity = PointOf(field("velocity"));
            TurnRate = number("turn_rate");
            var path = (List<object>)field("path") ?? new List<object>();
            Path = path.Cast<List<object>>().Select(point => new Point((double)point[0], (double)point[1])).ToList();
            Speed = (double?)field("speed");
            TurnTo = (double?)field("turn_to");
            Bottom = number("bottom");
            SinkDepth = number("sink_depth");
            ContactArea = number("contact_area");
            Pressure = number("pressure");
            Burden = number("burden");
            Resting = true.Equals(field("resting"));
        }

        static Point PointOf(object point)
        {
            var fields = point as Dictionary<string, object>;
            return fields == null ? default(Point) : new Point((double)fields["x"], (double)fields["z"]);
        }
    }

    /// <summary>Changes of objects, over the stream of a Heightfield. They throw what Heightfield.CommandAsync throws.</summary>
    public static class Colliders
    {
        /// <summary>Puts an object on the snow; replaces the one of the same id.</summary>
        public static async Task<Collider> PutAsync(this Heightfield snow, string id, ColliderFields fields)
        {
            return Collider.OfAck(await snow.CommandAsync("collider.put", "\"collider\":" + fields.ToJson(id)).ConfigureAwait(false));
        }

        /// <summary>Changes the fields of an object that are not null, or sweeps it to another place.</summary>
        public static async Task<Collider> PatchAsync(this Heightfield snow, string id, ColliderFields fields)
        {
            var patch = "\"collider\":\"" + id + "\",\"patch\":" + fields.ToJson(null);
            return Collider.OfAck(await snow.CommandAsync("collider.patch", patch).ConfigureAwait(false));
        }

        /// <summary>Removes an object.</summary>
        public static Task DeleteAsync(this Heightfield snow, string id)
        {
            return snow.CommandAsync("collider.delete", "\"collider\":\"" + id + "\"");
        }
    }

    /// <summary>As much of JSON as objects take.</summary>
    static class Json
    {
        public static string Number(double? number)
        {
            return number == null ? null : number.Value.ToString("R", CultureInfo.InvariantCulture);
        }

        public static string Truth(bool? truth) { return truth == null ? null : truth.Value ? "true" : "false"; }

        public static string Point(Point? point)
        {
            return point == null ? null : "{\"x\":" + Number(point.Value.X) + ",\"z\":" + Number(point.Value.Z) + "}";
        }

        public static string Points(IEnumerable<Point> points)
        {
            return "[" + string.Join(",", points.Select(point => "[" + Number(point.X) + "," + Number(point.Z) + "]")) + "]";
        }

        /// <summary>A Dictionary, a List, a string, a double, a bool or null.</summary>
        public static object Read(string json)
        {
            var at = 0;
            return Value(json, ref at);
        }

        static object Value(string json, ref int at)
        {
            switch (Next(json, ref at))
            {
                case '{':
                    var fields = new Dictionary<string, object>();
                    for (at++; Next(json, ref at) != '}'; Skip(json, ref at, ','))
                    {
                        var name = Text(json, ref at);
                        Next(json, ref at);
                        Skip(json, ref at, ':');
                        fields[name] = Value(json, ref at);
                    }
                    at++;
                    return fields;
                case '[':
                    var items = new List<object>();
                    for (at++; Next(json, ref at) != ']'; Skip(json, ref at, ',')) items.Add(Value(json, ref at));
                    at++;
                    return items;
                case '"':
                    return Text(json, ref at);
                default:
                    var begin = at;
                    while (at < json.Length && ",]} \n\r\t".IndexOf(json[at]) < 0) at++;
                    var word = json.Substring(begin, at - begin);
                    if (word == "null") return null;
                    if (word == "true" || word == "false") return word == "true";
                    return double.Parse(word, CultureInfo.InvariantCulture);
            }
        }

        static char Next(string json, ref int at)
        {
            while (at < json.Length && char.IsWhiteSpace(json[at])) at++;
            if (at == json.Length) throw new FormatException("the JSON ends too early");
            return json[at];
        }

        static void Skip(string json, ref int at, char expected)
        {
            if (Next(json, ref at) == expected) at++;
            else if (expected == ':') throw new FormatException("no colon at " + at);
        }

        /// <summary>A string; its escapes stay as they are, which names and kinds of shapes do not have.</summary>
        static string Text(string json, ref int at)
        {
            if (json[at] != '"') throw new FormatException("no string at " + at);
            var begin = ++at;
            for (; at < json.Length && json[at] != '"'; at++) if (json[at] == '\\') at++;
            if (at >= json.Length) throw new FormatException("the JSON ends too early");
            return json.Substring(begin, at++ - begin);
        }
    }
}
