-- Lets Wireshark dissect WSMs that travel inside UDP, as to and from a radio unit.
-- Use:  wireshark -X lua_script:wsm_udp.lua   or copy it to the personal Lua plugins folder.
-- A datagram is taken for a WSM if it is WSMP version 3 with a PSID, and its WSM length ends it.

local wsm_udp = Proto("wsm_udp", "WAVE Short Message in UDP")
local ETHERTYPE_WSMP = 0x88DC

-- 1609.3, 8.1.3: one octet up to 127, two from there. Returns value and next offset.
local function length_at(tvb, offset)
  if offset >= tvb:len() then return nil end
  local first = tvb(offset, 1):uint()
  if first < 0x80 then return first, offset + 1 end
  if first >= 0xC0 or offset + 2 > tvb:len() then return nil end
  return tvb(offset, 2):uint() - 0x8000, offset + 2
end

-- Returns the offset after a WAVE information element extension.
local function after_elements(tvb, offset)
  local count
  count, offset = length_at(tvb, offset)
  for _ = 1, count or 0 do
    local size
    size, offset = length_at(tvb, offset + 1)
    if not size then return nil end
    offset = offset + size
  end
  return offset
end

local function after_psid(tvb, offset)
  local first = tvb(offset, 1):uint()
  if first < 0x80 then return offset + 1 end
  if first < 0xC0 then return offset + 2 end
  if first < 0xE0 then return offset + 3 end
  if first < 0xF0 then return offset + 4 end
end

local function is_wsm(tvb)
  if tvb:len() < 4 then return false end
  local head = tvb(0, 1):uint()
  local offset = 1
  if head == 0x0B then
    offset = after_elements(tvb, offset)
  elseif head ~= 0x03 then
    return false
  end
  if not offset or offset + 2 > tvb:len() then return false end
  local tpid = tvb(offset, 1):uint()
  if tpid ~= 0 then return false end -- Wireshark's dissector knows no elements in the T-header
  offset = after_psid(tvb, offset + 1)
  if not offset then return false end
  local size, data = length_at(tvb, offset)
  return size ~= nil and data + size == tvb:len()
end

local function dissect(tvb, pinfo, tree)
  if not is_wsm(tvb) then return false end
  DissectorTable.get("ethertype"):get_dissector(ETHERTYPE_WSMP):call(tvb:range():tvb(), pinfo, tree)
  return true
end

function wsm_udp.dissector(tvb, pinfo, tree)
  dissect(tvb, pinfo, tree)
end

wsm_udp:register_heuristic("udp", dissect)
