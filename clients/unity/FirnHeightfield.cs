// Keeps the heights of a Firn session in sync, in Unity 2021 or newer or any other .NET. No packages: copy this file.
//
//     var snow = new Firn.Heightfield(new Uri("http://127.0.0.1:8080"), "demo");
//     _ = snow.RunAsync(cancellation);          // connects, and again whenever the connection is lost
//     if (snow.Poll()) { ... snow.Heights ... } // in Update(), on the main thread
//
// It speaks firn.v1.bin: api/asyncapi.yaml describes the messages, api/height-stream.md the bytes. FirnObjects.cs beside it has types
// for objects on the snow.

using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Net.WebSockets;
using System.Text;
using System.Text.RegularExpressions;
using System.Threading;
using System.Threading.Tasks;

namespace Firn
{
    /// <summary>The server refused the stream or ended it for good; connecting again does not help.</summary>
    public sealed class StreamEndedException : Exception
    {
        public StreamEndedException(string message) : base(message) { }
    }

    /// <summary>The server refused a command, and nothing has changed. The message is its problem details (RFC 9457), as JSON.</summary>
    public sealed class CommandRefusedException : Exception
    {
        public CommandRefusedException(string message) : base(message) { }
    }

    /// <summary>A mean depth of the snow on some columns, all where there is no width: it holds while that is above, or below, a depth [m].</summary>
    public sealed class DepthWatch
    {
        /// <summary>Its name, [A-Za-z0-9_-]{1,64}.</summary>
        public string Id;
        public int ColumnX, ColumnZ, Width, Depth;
        /// <summary>Exactly one of the two.</summary>
        public double? Above, Below;

        internal string ToJson()
        {
            var region = Width == 0 ? "" : string.Format(CultureInfo.InvariantCulture,
                ",\"region\":{{\"column_x\":{0},\"column_z\":{1},\"width\":{2},\"depth\":{3}}}", ColumnX, ColumnZ, Width, Depth);
            return "{\"id\":\"" + Id + "\"" + region + Limit("above", Above) + Limit("below", Below) + "}";
        }

        static string Limit(string name, double? depth)
        {
            return depth == null ? "" : ",\"" + name + "\":" + depth.Value.ToString("R", CultureInfo.InvariantCulture);
        }
    }

    /// <summary>How a watch stands.</summary>
    public struct WatchEvent
    {
        /// <summary>The watch.</summary>
        public string Id;
        /// <summary>Whether it holds by now.</summary>
        public bool Holds;
        /// <summary>Mean depth of the snow [m].</summary>
        public double MeanDepth;
        /// <summary>When.</summary>
        public ulong Tick, Seq;
    }

    /// <summary>Snow depths of all columns of a session, and the ground where it is wanted, kept in sync by a stream.</summary>
    public sealed class Heightfield
    {
        const int SubscriptionId = 1;
        const int FirstCodeForGood = 3500;
        static readonly TimeSpan FirstWait = TimeSpan.FromSeconds(0.25), LongestWait = TimeSpan.FromSeconds(5);
        static readonly TimeSpan Silence = TimeSpan.FromSeconds(10);

        readonly Uri uri;
        readonly string token;
        readonly double maxRate, quantum;
        readonly bool terrain, colliders;
        readonly object gate = new object();
        readonly Random random = new Random();

        // Written by the connection, under the gate.
        float[] received = new float[0], receivedGround = new float[0];
        int width, depth;
        float cellSize;
        ulong tick, seq;
        bool changed, groundChanged, whole;
        bool? recovered;
        // Of this connection, and of the state that is held.
        string epoch = "", heldEpoch = "";
        readonly List<HeightMessage> parts = new List<HeightMessage>();
        // How watches stand of which nobody has asked yet: of each the newest.
        readonly List<WatchEvent> standings = new List<WatchEvent>();
        string receivedColliders = "[]";
        // Commands that wait for an answer, and the socket that they are sent on; a socket takes one message at a time.
        readonly Dictionary<long, TaskCompletionSource<string>> pending = new Dictionary<long, TaskCompletionSource<string>>();
        readonly SemaphoreSlim sending = new SemaphoreSlim(1);
        ClientWebSocket open;
        long lastId = SubscriptionId;

        /// <param name="server">As in http://127.0.0.1:8080.</param>
        /// <param name="token">An API key or one of the session's tokens, where the server asks for one.</param>
        /// <param name="maxRate">Most messages per second [Hz], 0.1 to 60.</param>
        /// <param name="quantum">Step that heights are rounded to [m].</param>
        /// <param name="terrain">Whether the ground is wanted too.</param>
        /// <param name="colliders">Whether the objects on the snow are wanted too.</param>
        public Heightfield(
            Uri server, string session, string token = null, double maxRate = 20, double quantum = 0.001, bool terrain = false,
            bool colliders = false)
        {
            var address = new UriBuilder(server) { Scheme = server.Scheme == "https" ? "wss" : "ws" };
            address.Path = "/v1/sessions/" + Uri.EscapeDataString(session) + "/stream";
            uri = address.Uri;
            this.token = token;
            this.maxRate = maxRate;
            this.quantum = quantum;
            this.terrain = terrain;
            this.colliders = colliders;
        }

        /// <summary>Depths whose crossing is told, at most 16; to be filled before RunAsync.</summary>
        public List<DepthWatch> Watches { get; } = new List<DepthWatch>();

        /// <summary>Columns along x and along z, as of the last Poll.</summary>
        public int Width { get; private set; }
        public int Depth { get; private set; }

        /// <summary>Side of a column [m].</summary>
        public float CellSize { get; private set; }

        /// <summary>Snow depths [m], row by row: index = z * Width + x. As of the last Poll.</summary>
        public float[] Heights { get; private set; } = new float[0];

        /// <summary>Elevations of the ground [m], as Heights; none unless they are wanted.</summary>
        public float[] Ground { get; private set; } = new float[0];

        /// <summary>The objects on the snow, as a JSON array for Collider.ReadAll of FirnObjects.cs; "[]" unless they are wanted.</summary>
        public string Colliders { get; private set; } = "[]";

        /// <summary>When they held.</summary>
        public ulong Tick { get; private set; }

        /// <summary>Number of the state that they are of. It only grows, and may exceed 32 bits.</summary>
        public ulong Seq { get; private set; }

        /// <summary>After a lost connection: whether exactly what was missed was sent; null before.</summary>
        public bool? Recovered { get; private set; }

        /// <summary>Takes over the newest state; whether anything has changed. Call it on the thread that reads.</summary>
        public bool Poll()
        {
            lock (gate)
            {
                if (!changed) return false;
                changed = false;
                if (Heights.Length != received.Length) Heights = new float[received.Length];
                Array.Copy(received, Heights, received.Length);
                if (groundChanged) Ground = (float[])receivedGround.Clone();
                groundChanged = false;
                Colliders = receivedColliders;
                Width = width;
                Depth = depth;
                CellSize = cellSize;
                Tick = tick;
                Seq = seq;
                Recovered = recovered;
                return true;
            }
        }

        /// <summary>How a watch stands that has not been told of yet: at first, after each reconnection, and with each crossing.</summary>
        public bool PollWatch(out WatchEvent told)
        {
            lock (gate)
            {
                told = standings.Count > 0 ? standings[0] : default(WatchEvent);
                if (standings.Count == 0) return false;
                standings.RemoveAt(0);
                return true;
            }
        }

        /// <summary>Sends a change and returns its ack, as JSON. It is named and filled as in api/asyncapi.yaml:
        /// CommandAsync("snowfall", "\"depth\":0.2"). Throws CommandRefusedException where it is refused. Throws IOException where the
        /// stream is not connected, or is lost before the answer: then the change may have happened or not.</summary>
        public async Task<string> CommandAsync(string op, string fields, CancellationToken cancellation = default(CancellationToken))
        {
            var answer = new TaskCompletionSource<string>(TaskCreationOptions.RunContinuationsAsynchronously);
            ClientWebSocket socket;
            long id;
            lock (gate)
            {
                if (open == null) throw new IOException("the stream is not connected");
                socket = open;
                id = ++lastId;
                pending.Add(id, answer);
            }
            try
            {
                var text = "{\"op\":\"" + op + "\",\"id\":" + id + (fields.Length > 0 ? "," : "") + fields + "}";
                await SendAsync(socket, text, cancellation).ConfigureAwait(false);
                using (cancellation.Register(() => answer.TrySetCanceled())) return await answer.Task.ConfigureAwait(false);
            }
            catch (WebSocketException error) { throw new IOException("the connection was lost", error); }
            finally
            {
                lock (gate) pending.Remove(id);
            }
        }

        /// <summary>Ends the commands that wait for an answer of a connection that is lost.</summary>
        void Disconnect()
        {
            lock (gate)
            {
                open = null;
                foreach (var answer in pending.Values) answer.TrySetException(new IOException("the connection was lost"));
            }
        }

        /// <summary>Gives a command its answer; whether it was one that waits.</summary>
        bool Answer(string text, bool refused)
        {
            var id = Regex.Match(text, "\"id\"\\s*:\\s*([0-9]+)");
            TaskCompletionSource<string> answer;
            lock (gate)
            {
                if (!id.Success || !pending.TryGetValue(long.Parse(id.Groups[1].Value, CultureInfo.InvariantCulture), out answer)) return false;
            }
            if (refused) answer.TrySetException(new CommandRefusedException(text));
            else answer.TrySetResult(text);
            return true;
        }

        /// <summary>Keeps in sync until it is cancelled. Throws StreamEndedException where the server ends it for good.</summary>
        public async Task RunAsync(CancellationToken cancellation)
        {
            var wait = FirstWait;
            while (true)
            {
                try
                {
                    using (var socket = await ConnectAsync(cancellation).ConfigureAwait(false))
                    {
                        wait = FirstWait;
                        try { await ReceiveAsync(socket, cancellation).ConfigureAwait(false); }
                        finally { Disconnect(); }
                    }
                }
                catch (Exception error) when (!cancellation.IsCancellationRequested && IsPassing(error)) { }
                // Not all clients of a server that was restarted come back at the same moment.
                var pause = TimeSpan.FromTicks((long)(wait.Ticks * (0.5 + 0.5 * random.NextDouble())));
                await Task.Delay(pause, cancellation).ConfigureAwait(false);
                wait = wait + wait < LongestWait ? wait + wait : LongestWait;
            }
        }

        /// <summary>Whether connecting again may help.</summary>
        static bool IsPassing(Exception error)
        {
            return error is WebSocketException || error is IOException || error is InvalidDataException
                || error is OperationCanceledException;
        }

        async Task<ClientWebSocket> ConnectAsync(CancellationToken cancellation)
        {
            var socket = new ClientWebSocket();
            socket.Options.AddSubProtocol("firn.v1.bin");
            socket.Options.KeepAliveInterval = TimeSpan.FromSeconds(5);
            if (token != null) socket.Options.SetRequestHeader("Authorization", "Bearer " + token);
            try
            {
                await socket.ConnectAsync(uri, cancellation).ConfigureAwait(false);
            }
            catch
            {
                socket.Dispose();
                throw;
            }
            return socket;
        }

        async Task ReceiveAsync(ClientWebSocket socket, CancellationToken cancellation)
        {
            var buffer = new ArraySegment<byte>(new byte[16384]);
            var message = new MemoryStream();
            while (true)
            {
                // Asks for a sign of life from time to time: a connection can be dead without saying so.
                using (var patience = CancellationTokenSource.CreateLinkedTokenSource(cancellation))
                using (new Timer(_ => Ping(socket, cancellation), null, Silence, Silence))
                {
                    patience.CancelAfter(Silence + Silence);
                    var part = await socket.ReceiveAsync(buffer, patience.Token).ConfigureAwait(false);
                    if (part.MessageType == WebSocketMessageType.Close) { Closed(socket); return; }
                    message.Write(buffer.Array, 0, part.Count);
                    if (!part.EndOfMessage) continue;
                    var data = message.ToArray();
                    message.SetLength(0);
                    if (part.MessageType == WebSocketMessageType.Binary) lock (gate) Take(data);
                    else await TakeTextAsync(socket, Encoding.UTF8.GetString(data), cancellation).ConfigureAwait(false);
                }
            }
        }

        async void Ping(ClientWebSocket socket, CancellationToken cancellation)
        {
            try { await SendAsync(socket, "{\"op\":\"ping\"}", cancellation).ConfigureAwait(false); }
            catch (Exception) { } // whoever receives finds out
        }

        async Task SendAsync(ClientWebSocket socket, string text, CancellationToken cancellation)
        {
            var bytes = new ArraySegment<byte>(Encoding.UTF8.GetBytes(text));
            await sending.WaitAsync(cancellation).ConfigureAwait(false);
            try { await socket.SendAsync(bytes, WebSocketMessageType.Text, true, cancellation).ConfigureAwait(false); }
            finally { sending.Release(); }
        }

        static void Closed(ClientWebSocket socket)
        {
            var code = (int)(socket.CloseStatus ?? 0);
            if (code == 1000 || code >= FirstCodeForGood)
                throw new StreamEndedException(socket.CloseStatusDescription + " (" + code + ")");
        }

        Task TakeTextAsync(ClientWebSocket socket, string text, CancellationToken cancellation)
        {
            switch (Field(text, "op", "\"([^\"]*)\""))
            {
                case "welcome":
                    string subscribe;
                    lock (gate)
                    {
                        subscribe = Begin(text);
                        open = socket;
                    }
                    return SendAsync(socket, subscribe, cancellation);
                case "event":
                    if (Field(text, "event", "\"([^\"]*)\"") == "watch") lock (gate) TakeWatch(text);
                    return Task.CompletedTask;
                case "ack":
                    Answer(text, false);
                    return Task.CompletedTask;
                case "error":
                    if (Answer(text, true)) return Task.CompletedTask;
                    throw new StreamEndedException(text);
                default:
                    return Task.CompletedTask;
            }
        }

        void TakeWatch(string text)
        {
            var told = new WatchEvent
            {
                Id = Field(text, "id", "\"([^\"]*)\""),
                Holds = Field(text, "holds", "(true|false)") == "true",
                MeanDepth = double.Parse(Field(text, "mean_depth", "([-+0-9.eE]+)"), CultureInfo.InvariantCulture),
                Tick = ulong.Parse(Field(text, "tick", "([0-9]+)"), CultureInfo.InvariantCulture),
                Seq = ulong.Parse(Field(text, "seq", "([0-9]+)"), CultureInfo.InvariantCulture),
            };
            standings.RemoveAll(before => before.Id == told.Id);
            standings.Add(told);
        }

        /// <summary>What to send once the stream is open. Who holds everything asks for what it missed only.</summary>
        string Begin(string welcome)
        {
            var grid = welcome.Substring(welcome.IndexOf("\"grid\"", StringComparison.Ordinal));
            var wide = int.Parse(Field(grid, "width", "([0-9]+)"), CultureInfo.InvariantCulture);
            var deep = int.Parse(Field(grid, "depth", "([0-9]+)"), CultureInfo.InvariantCulture);
            if (wide != width || deep != depth)
            {
                received = new float[wide * deep];
                receivedGround = new float[terrain ? wide * deep : 0];
                whole = false;
            }
            width = wide;
            depth = deep;
            parts.Clear();
            cellSize = float.Parse(Field(grid, "cell_size", "([-+0-9.eE]+)"), CultureInfo.InvariantCulture);
            var resume = whole ? ",\"resume\":{\"epoch\":\"" + heldEpoch + "\",\"seq\":" + seq + "}" : "";
            epoch = Field(welcome, "epoch", "\"([^\"]*)\"");
            var watches = string.Join(",", Watches.ConvertAll(watch => watch.ToJson()));
            return string.Format(CultureInfo.InvariantCulture,
                "{{\"op\":\"subscribe\",\"id\":{0},\"max_rate\":{1:R},\"quantum\":{2:R},\"terrain\":{3},\"colliders\":{4},\"watch\":[{5}]{6}}}",
                SubscriptionId, maxRate, quantum, terrain ? "true" : "false", colliders ? "true" : "false", watches, resume);
        }

        static string Field(string json, string name, string value)
        {
            var match = Regex.Match(json, "\"" + name + "\"\\s*:\\s*" + value);
            if (!match.Success) throw new InvalidDataException("no " + name + " in " + json);
            return match.Groups[1].Value;
        }

        /// <summary>Takes in a message of heights, or a part of one: it counts once its last part is there.</summary>
        void Take(byte[] data)
        {
            var last = new HeightMessage(data);
            parts.Add(last);
            if (last.More) return;
            // What can't be read to its end is asked for anew, all of it.
            whole = false;
            foreach (var part in parts) Read(part);
            var told = parts.FindAll(part => part.Colliders != null).ConvertAll(part => Items(part.Colliders));
            if (told.Count > 0) receivedColliders = "[" + string.Join(",", told.FindAll(items => items.Length > 0)) + "]";
            recovered = parts[0].Recovered ?? recovered;
            parts.Clear();
            tick = last.Tick;
            seq = last.Seq;
            heldEpoch = epoch;
            // The subscription is of all columns, and began with those that were not held.
            whole = changed = true;
        }

        /// <summary>A JSON array without its brackets.</summary>
        static string Items(string array)
        {
            var trimmed = array.Trim();
            if (trimmed.Length < 2 || trimmed[0] != '[') throw new InvalidDataException("no list of objects: " + array);
            return trimmed.Substring(1, trimmed.Length - 2).Trim();
        }

        void Read(HeightMessage part)
        {
            groundChanged |= part.Level || part.TellsGround;
            if (part.Level) Array.Clear(receivedGround, 0, receivedGround.Length);
            part.ReadTiles(
                (x, z, tileWidth, tileDepth, heights) => Put(false, x, z, tileWidth, tileDepth, heights),
                (x, z, tileWidth, tileDepth, heights) => Put(true, x, z, tileWidth, tileDepth, heights));
        }

        void Put(bool isGround, int columnX, int columnZ, int tileWidth, int tileDepth, uint[] heights)
        {
            var field = isGround ? receivedGround : received;
            if (columnX + tileWidth > width || columnZ + tileDepth > depth) throw new InvalidDataException("a tile is beyond the grid");
            if (field.Length == 0) return; // ground that was not asked for
            for (var z = 0; z < tileDepth; z++)
                for (var x = 0; x < tileWidth; x++)
                {
                    var steps = heights[z * tileWidth + x];
                    var metres = isGround ? (int)steps / HeightMessage.GroundStepsPerMetre : steps * quantum;
                    field[(columnZ + z) * width + columnX + x] = (float)metres;
                }
        }
    }

    /// <summary>A binary message of heights. Throws InvalidDataException for what api/height-stream.md does not describe.</summary>
    public sealed class HeightMessage
    {
        const int Side = 8;
        const uint MostTiles = 1 << 24;

        /// <summary>Steps that elevations of the ground are told in, of each metre.</summary>
        public const double GroundStepsPerMetre = 10000;

        /// <summary>First column along x and z, samples along x and z, heights in quanta row by row, or elevations in tenths of a
        /// millimetre, which are negative where they are taken as int; valid in the call only.</summary>
        public delegate void Tile(int columnX, int columnZ, int width, int depth, uint[] heights);

        public readonly bool Snapshot, More;
        /// <summary>Whether all ground is level at 0 but what is told, and whether tiles of ground are told.</summary>
        public readonly bool Level, TellsGround;
        public readonly bool? Recovered;
        public readonly long Id;
        public readonly ulong Seq, Tick;
        public readonly int Stride;
        /// <summary>The objects in the region as JSON, where they are told. Known after ReadTiles.</summary>
        public string Colliders { get; private set; }

        readonly byte[] data;
        readonly bool tellsColliders;
        readonly uint[] heights = new uint[Side * Side];
        int at, width, depth;

        public HeightMessage(byte[] data)
        {
            this.data = data;
            var kind = Byte();
            if (kind != 1 && kind != 2) throw Wrong("neither a snapshot nor a delta");
            var flags = Byte();
            if ((flags & 6) == 4) throw Wrong("these flags have no meaning");
            Snapshot = kind == 1;
            More = (flags & 1) != 0;
            if ((flags & 2) != 0) Recovered = (flags & 4) != 0;
            tellsColliders = (flags & 8) != 0;
            TellsGround = (flags & 0x40) != 0;
            Level = (flags & 0x80) != 0;
            Stride = 1 << ((flags >> 4) & 3);
            var code = Number();
            Id = (long)(code >> 1) ^ -(long)(code & 1);
            Seq = Number();
            Tick = Number();
        }

        /// <summary>Reads all tiles of snow and of ground, once.</summary>
        public void ReadTiles(Tile put, Tile putGround)
        {
            var tilesX = Short();
            if (tilesX == 0) throw Wrong("a grid has at least one tile in a row");
            ReadRuns(tilesX, put);
            if (TellsGround) ReadRuns(tilesX, putGround);
            if (tellsColliders) Colliders = new UTF8Encoding(false, true).GetString(data, at, data.Length - at);
            else if (at != data.Length) throw Wrong("there are bytes after the last tile");
        }

        void ReadRuns(uint tilesX, Tile put)
        {
            ulong place = 0;
            for (var runs = Number(); runs > 0; runs--)
            {
                place += Short();
                var code = Number();
                var count = code >> 1;
                if (count == 0 || count > MostTiles || place + count > MostTiles) throw Wrong("a run has 1 to 2^24 tiles");
                for (ulong i = 0; i < count; i++, place++)
                {
                    if (i == 0 || (code & 1) == 0) ReadTile();
                    put((int)(place % tilesX) * Side, (int)(place / tilesX) * Side, width, depth, heights);
                }
            }
        }

        void ReadTile()
        {
            var flags = Byte();
            if ((flags & ~3) != 0) throw Wrong("these flags of a tile have no meaning");
            width = depth = Side / Stride;
            if ((flags & 2) != 0)
            {
                var size = Byte();
                if (size >= Side * Side) throw Wrong("a tile has at most 8 samples along a side");
                width = size % Side + 1;
                depth = size / Side + 1;
            }
            var level = Short();
            for (var i = 0; i < width * depth; i++) heights[i] = level;
            if ((flags & 1) == 0) return;
            var coded = Byte();
            if (coded >> depth != 0) throw Wrong("a row is beyond the tile");
            for (var z = 0; z < depth; z++)
            {
                if (((coded >> z) & 1) != 0) ReadRow(z, level);
                else if (z > 0) Array.Copy(heights, (z - 1) * width, heights, z * width, width);
            }
        }

        void ReadRow(int z, uint level)
        {
            var code = Byte();
            var bits = (code & 31) == 31 ? 32 : code & 31;
            var predictor = (code >> 5) & 3;
            if (predictor == 3) throw Wrong("there is no such predictor");
            var there = (code & 0x80) != 0 ? Byte() : (1 << width) - 1;
            if (there >> width != 0) throw Wrong("a residual is beyond the row");
            var count = 0;
            for (var x = 0; x < width; x++) count += (there >> x) & 1;
            var bit = (long)at * 8;
            at += (count * bits + 7) / 8;
            if (at > data.Length) throw Wrong("the message ends too early");
            uint aboveLeft = 0;
            for (var x = 0; x < width; x++)
            {
                var index = z * width + x;
                uint residual = 0;
                if (((there >> x) & 1) != 0)
                    for (var i = 0; i < bits; i++, bit++)
                        residual |= (uint)((data[bit >> 3] >> (int)(bit & 7)) & 1) << i;
                var above = z == 0 ? level : heights[index - width];
                unchecked
                {
                    var guess = above;
                    if (x > 0 && predictor == 0) guess = heights[index - 1];
                    if (x > 0 && predictor == 2) guess = heights[index - 1] + above - aboveLeft;
                    heights[index] = guess + ((residual >> 1) ^ (0u - (residual & 1)));
                }
                aboveLeft = above;
            }
        }

        int Byte()
        {
            if (at >= data.Length) throw Wrong("the message ends too early");
            return data[at++];
        }

        ulong Number()
        {
            ulong value = 0;
            for (var shift = 0; shift < 64; shift += 7)
            {
                var next = Byte();
                if (shift == 63 && (next & 0x7f) > 1) break;
                value |= (ulong)(next & 0x7f) << shift;
                if ((next & 0x80) == 0) return value;
            }
            throw Wrong("a number has more than 64 bits");
        }

        uint Short()
        {
            var value = Number();
            if (value > uint.MaxValue) throw Wrong("a number has more than 32 bits");
            return (uint)value;
        }

        InvalidDataException Wrong(string what)
        {
            return new InvalidDataException("byte " + Math.Max(at - 1, 0) + ": " + what);
        }
    }
}
